// A fuzz target is one function, over which target.cpp runs libFuzzer.
#pragma once

#include <string_view>

namespace unseen::fuzz {

// Whether the readers accept the bytes. Aborts if they break a promise.
bool accepts(std::string_view bytes);

} // namespace unseen::fuzz
