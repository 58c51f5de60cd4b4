// Numbers in the words of people.
#pragma once

#include <cstdint>
#include <string>

namespace unseen {

// 69666 -> "69,666".
std::string grouped(std::uint64_t count);

// So many significant digits at most, written out: 61,800 or 61.8 or 0.00618. Only what is smaller than a millionth, or
// larger than people have words for, has an exponent. "none" for NaN, "infinite" for infinities.
std::string rounded(double value, int significant);

// So many decimals, written out: 61,800.0. As rounded() where the value is not finite.
std::string with_decimals(double value, int decimals);

// As many digits as needed to read the same value again; no groups, so that programs can.
std::string shortest(double value);

} // namespace unseen
