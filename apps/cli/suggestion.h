// "Did you mean ...?"
#pragma once

#include <string>
#include <string_view>
#include <vector>

namespace unseen::app {

// The name that a slip of the fingers may have become `typed`: ": did you mean 'simplify'?". Empty where none is near.
std::string suggestion(std::string_view typed, const std::vector<std::string>& names);

} // namespace unseen::app
