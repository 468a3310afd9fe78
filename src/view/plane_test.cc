#include "view/plane.h"

#include <gtest/gtest.h>

#include "tomofield/error.h"

namespace tomofield::view {
namespace {

Parameters good_request() {
  return {{"center", "1,-2,3.5"}, {"right", "0,0,1"}, {"up", "0,1,0"},
          {"width", "4096"},      {"height", "2"},    {"step", "0.25"}};
}

TEST(RequestedPlane, IsWhatTheRequestSays) {
  const Plane plane = requested_plane(good_request());
  EXPECT_EQ(plane.centre, (Point{1, -2, 3.5}));
  EXPECT_EQ(plane.width, 4096);
  EXPECT_EQ(plane.height, 2);
  EXPECT_EQ(plane.position(2048, 1), plane.centre);
  EXPECT_EQ(plane.position(2050, 0), (Point{1, -2.25, 4}));
}

TEST(RequestedPlane, RefusesEveryOtherText) {
  const std::pair<const char*, const char*> faults[] = {
      {"center", "1,2"},      {"center", "1,2,3,4"},   {"center", "1,2,nan"}, {"center", ""},
      {"center", "1,2,1e99"}, {"right", "0,0,2"},      {"right", "0,1,0"},    {"up", "0,0,0"},
      {"width", "4097"},      {"width", "0"},          {"width", "-1"},       {"width", "1.5"},
      {"height", "1e9"},      {"height", "../../etc"}, {"step", "0"},         {"step", "-1"},
      {"step", "inf"},        {"step", "1 "}};
  for (const auto& [name, text] : faults) {
    Parameters request = good_request();
    request[name] = text;
    EXPECT_THROW(requested_plane(request), Error) << name << "=" << text;
  }
  for (const auto& [name, text] : good_request()) {
    Parameters request = good_request();
    request.erase(name);
    EXPECT_THROW(requested_plane(request), Error) << name;
  }
}

}  // namespace
}  // namespace tomofield::view
