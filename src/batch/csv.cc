#include "batch/csv.h"

#include <fmt/format.h>

#include <utility>

#include "io/tables/text_lines.h"
#include "tomofield/error.h"

namespace tomofield::batch {
namespace {

constexpr std::string_view kByteOrderMark = "\xEF\xBB\xBF";

// Reads fields one after another and counts the lines.
class Reader {
 public:
  Reader(std::string_view text, char separator) : text_(text), separator_(separator) {
    if (text_.starts_with(kByteOrderMark)) at_ = kByteOrderMark.size();
  }

  bool is_at_end() const { return at_ == text_.size(); }

  // Reads a record with its line end. A blank line gives one empty field.
  CsvRecord record() {
    CsvRecord read{.line = line_, .fields = {}};
    do {
      read.fields.push_back(field());
    } while (skip(separator_));
    skip('\r');
    if (!is_at_end() && text_[at_] != '\n')
      throw Error(
          fmt::format("line {}: there is text after a closing quote; a quote inside of "
                      "quotes is written twice",
                      line_));
    skip('\n');
    return read;
  }

 private:
  bool skip(char wanted) {
    if (is_at_end() || text_[at_] != wanted) return false;
    ++at_;
    if (wanted == '\n') ++line_;
    return true;
  }

  void skip_blanks() {
    while (!is_at_end() && text_[at_] != separator_ && (text_[at_] == ' ' || text_[at_] == '\t'))
      ++at_;
  }

  std::string field() {
    skip_blanks();
    if (!skip('"')) return plain();
    std::string value = quoted();
    skip_blanks();
    return value;
  }

  std::string plain() {
    const std::size_t begin = at_;
    while (!is_at_end() && text_[at_] != separator_ && text_[at_] != '\n') ++at_;
    std::string_view value = text_.substr(begin, at_ - begin);
    if (value.ends_with('\r')) --at_;
    return std::string(io::trim(value));
  }

  // Reads up to the closing quote.
  std::string quoted() {
    const int first_line = line_;
    std::string value;
    for (; !is_at_end(); ++at_) {
      if (text_[at_] == '"') {
        ++at_;
        if (is_at_end() || text_[at_] != '"') return value;
      }
      if (text_[at_] == '\n') ++line_;
      value += text_[at_];
    }
    throw Error(fmt::format("line {}: a quote is not closed", first_line));
  }

  std::string_view text_;
  char separator_;
  std::size_t at_ = 0;
  int line_ = 1;
};

}  // namespace

std::vector<CsvRecord> parse_csv(std::string_view text, char separator) {
  std::vector<CsvRecord> records;
  for (Reader reader(text, separator); !reader.is_at_end();) {
    CsvRecord record = reader.record();
    if (record.fields.size() > 1 || !record.fields.front().empty())
      records.push_back(std::move(record));
  }
  return records;
}

std::string spreadsheet_text(std::string_view text) {
  const bool may_run =
      !text.empty() && (std::string_view("=+-@").find(text.front()) != std::string_view::npos ||
                        static_cast<unsigned char>(text.front()) < ' ');
  return (may_run ? "'" : "") + std::string(text);
}

std::string csv_field(std::string_view text) {
  if (text.find_first_of(",;\"\r\n\t") == std::string_view::npos && io::trim(text) == text)
    return std::string(text);
  std::string quoted = "\"";
  for (const char c : text) quoted += c == '"' ? "\"\"" : std::string(1, c);
  return quoted + "\"";
}

}  // namespace tomofield::batch
