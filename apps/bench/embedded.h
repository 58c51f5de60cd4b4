// Files compiled into the program by EmbedFiles.cmake.
#pragma once

#include <string_view>

namespace unseen::app::embedded {

extern const std::string_view targets_json;

} // namespace unseen::app::embedded
