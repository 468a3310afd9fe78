#pragma once

#include <gtest/gtest.h>

#include <string>
#include <vector>

namespace tomofield::testing {

/// Expects that a message has all of these parts.
inline void expect_parts(const std::string& message, const std::vector<std::string>& parts) {
  for (const std::string& part : parts)
    EXPECT_NE(message.find(part), std::string::npos) << "'" << part << "' in: " << message;
}

}  // namespace tomofield::testing
