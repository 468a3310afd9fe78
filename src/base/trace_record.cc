#include "base/trace_record.h"

#include <nlohmann/json.hpp>

namespace tomofield::base {

std::string text_of(const TraceEvent& e) {
  constexpr const char* kCategories[] = {"span", "loop", "task"};
  nlohmann::json args = nlohmann::json::object();
  if (e.kind != TraceEvent::Kind::kSpan) args["loop"] = e.loop;
  if (e.kind == TraceEvent::Kind::kTask) args.update({{"task", e.task}, {"index", e.index}});
  if (e.kind == TraceEvent::Kind::kLoop) {
    args.update({{"in_task", e.outer_task},
                 {"tasks", e.count},
                 {"busy_s", 1e-9 * static_cast<double>(e.busy)},
                 {"longest_s", 1e-9 * static_cast<double>(e.longest)}});
  }
  const nlohmann::json object{{"name", e.name},
                              {"cat", kCategories[static_cast<int>(e.kind)]},
                              {"ph", "X"},
                              {"pid", 1},
                              {"tid", e.thread},
                              {"ts", 1e-3 * static_cast<double>(e.begin)},
                              {"dur", 1e-3 * static_cast<double>(e.end - e.begin)},
                              {"tdur", 1e-3 * static_cast<double>(e.processor)},
                              {"args", args}};
  return object.dump();
}

}  // namespace tomofield::base
