// A small font for labels in pictures: 5 x 7 pixels a glyph.
#pragma once

#include <string_view>

namespace unseen::app {

inline constexpr int glyph_width = 5;
inline constexpr int glyph_height = 7;
inline constexpr int glyph_advance = 6; // from one character to the next

// Rows from the top, each of glyph_width characters, '#' where there is ink. Characters outside of printable ASCII come
// out as a question mark.
std::string_view glyph(char character);

} // namespace unseen::app
