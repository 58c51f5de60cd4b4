// What nearly every test uses: GoogleTest and its matchers, the standard library, results that must be there.
#pragma once

#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <iterator>
#include <limits>
#include <map>
#include <memory>
#include <numbers>
#include <numeric>
#include <optional>
#include <random>
#include <set>
#include <source_location>
#include <span>
#include <sstream>
#include <stdexcept>
#include <string>
#include <string_view>
#include <thread>
#include <tuple>
#include <utility>
#include <vector>

#include <glm/geometric.hpp>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

using ::testing::AllOf;
using ::testing::AnyOf;
using ::testing::Contains;
using ::testing::Each;
using ::testing::ElementsAre;
using ::testing::EndsWith;
using ::testing::FloatEq;
using ::testing::FloatNear;
using ::testing::Ge;
using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Le;
using ::testing::Not;
using ::testing::SizeIs;
using ::testing::StartsWith;
using ::testing::UnorderedElementsAre;

namespace unseen {

// The result, pointer or optional itself; where there is none, the test ends.
template <class Result>
Result require(Result result, std::source_location where = std::source_location::current()) {
    if (!result) {
        std::string message = std::string(where.file_name()) + ":" + std::to_string(where.line()) + ": no result";
        if constexpr (requires { result.error(); }) message += ": " + result.error().message;
        throw std::runtime_error(message);
    }
    return result;
}

// The message of the error; nothing, which no test expects, where there is a result.
template <class Result>
std::string error_in(const Result& result) {
    return result ? "" : result.error().message;
}

} // namespace unseen
