#include "io/json.h"

#include <gtest/gtest.h>

#include <string>

#include "scratch_directory.h"
#include "tomofield/error.h"

namespace tomofield::io {
namespace {

using testing::message_of;

TEST(JsonNumbers, PlausibleOnesAreRead) {
  const auto object = parse_json(R"({"a": 1.5, "n": -3, "list": [0, 2.5]})");
  EXPECT_EQ(number_at(object, "a", 0, 2), 1.5);
  EXPECT_EQ(number_at(object, "n", -3, 2), -3);
  EXPECT_EQ(integer_at(object, "n", -3, 2), -3);
  EXPECT_EQ(numbers_at(object, "list", 0, 2.5), (std::vector<double>{0, 2.5}));
}

TEST(JsonNumbers, OthersAreRefusedByName) {
  const auto object = parse_json(
      R"({"text": "1", "none": null, "huge": 1e300, "real": 1.5, "long": 18446744073709551615,
          "list": [1, null], "object": {}})");
  for (const char* key : {"text", "none", "huge", "list", "object", "absent"}) {
    const std::string said = message_of<Error>([&] { number_at(object, key, 0, 1e9); });
    EXPECT_NE(said.find(key), std::string::npos) << said;
  }
  for (const char* key : {"text", "none", "huge", "real", "long", "list"})
    EXPECT_THROW(integer_at(object, key, 0, INT64_MAX), Error) << key;
  for (const char* key : {"text", "list", "real", "absent"})
    EXPECT_THROW(numbers_at(object, key, 0, 1e9), Error) << key;
  EXPECT_THROW(number_at(parse_json("[1]"), "a", 0, 1), Error);
}

TEST(JsonNumbers, DamagedAndDeeplyNestedDocumentsAreRefused) {
  for (const std::string& text :
       {std::string(), std::string("{"), std::string("1e999"), std::string("\xff"),
        std::string(1000000, '['), std::string(100, '[') + std::string(100, ']')})
    EXPECT_THROW(parse_json(text), Error) << text.substr(0, 20);
}

TEST(JsonNumbers, FaultsOfADocumentAreSaidInPlainWords) {
  const std::string broken = message_of<Error>([] { parse_json("{\n \"a\": 1,\n}"); });
  EXPECT_EQ(broken, "it is no JSON from line 3, column 1 on");
  const auto fault_of = [](const auto& read) {
    try {
      read(parse_json(R"({"a": 1})"));
    } catch (const nlohmann::json::exception& fault) {
      return fault_text(fault);
    }
    return std::string();
  };
  EXPECT_EQ(fault_of([](const auto& object) { object.at("it's"); }), "there is no 'it's'");
  for (const auto& said :
       {fault_of([](const auto& object) { object.at("a").at("b"); }),
        fault_of([](const auto& object) { object.at("a").template get<std::string>(); })})
    EXPECT_NE(said.find("another kind"), std::string::npos) << said;
}

TEST(JsonNumbers, OnlyRegularFilesOfFairSizeAreRead) {
  const testing::ScratchDirectory scratch;
  EXPECT_EQ(read_json(scratch.write("a.json", "[1]"))[0], 1);
  EXPECT_THROW(read_json("/dev/zero"), Error);
  EXPECT_THROW(read_json(scratch / "absent.json"), Error);
}

}  // namespace
}  // namespace tomofield::io
