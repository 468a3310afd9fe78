#include "batch/faults.h"

#include <fmt/format.h>

#include "base/log.h"
#include "tomofield/error.h"

namespace tomofield::batch {

void Faults::require_none() const {
  if (sentences_.empty()) return;
  if (sentences_.size() == 1) throw Error(sentences_.front());
  for (const std::string& sentence : sentences_) base::log_info(sentence);
  throw Error(fmt::format("these {} mistakes are to be mended first; nothing was started",
                          sentences_.size()));
}

}  // namespace tomofield::batch
