// Numbers in sentences.
#pragma once

#include <cstdint>
#include <string>

namespace unseen::session {

std::string grouped(std::uint64_t count);           // 69666 -> "69,666"
std::string rounded(double value, int significant); // shortest of so many digits; "infinite" and "none" (NaN) in words

} // namespace unseen::session
