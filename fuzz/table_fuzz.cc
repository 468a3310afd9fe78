#include <cstdlib>
#include <string>
#include <vector>

#include "batch/csv.h"
#include "batch/series_list.h"
#include "fuzz_input.h"

namespace {

using namespace tomofield;

// Any name stands for an option of some kind.
batch::ColumnKind kind_of(const std::string& flag) {
  return static_cast<batch::ColumnKind>(flag.size() % 4);
}

// Fields that were read must be the same after they are written and read again.
void write_and_read(const std::vector<batch::CsvRecord>& records) {
  for (const batch::CsvRecord& record : records) {
    std::string line = "first";  // a byte order mark after it is text
    for (const std::string& field : record.fields) line += "," + batch::csv_field(field);
    std::vector<std::string> fields = batch::parse_csv(line, ',').front().fields;
    fields.erase(fields.begin());
    if (fields != record.fields) std::abort();
  }
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  const std::string text(reinterpret_cast<const char*>(data), size);
  fuzz::refuse_or([&] { write_and_read(batch::parse_csv(text, ',')); });
  fuzz::refuse_or([&] { write_and_read(batch::parse_csv(text, '\t')); });
  const fuzz::InputFile file(data, size);
  fuzz::refuse_or([&] {
    base::Faults faults;
    batch::read_table(file.path(), {kind_of, {"thickness", "tlt"}}, faults);
    batch::require_none(faults);
  });
  return 0;
}
