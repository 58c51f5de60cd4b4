// The options of the command for the fields that the session library speaks of.
#pragma once

#include <string>

namespace unseen::app {

// "request.chroma and scene.lights exclude each other" -> "--chroma and --lights exclude each other".
std::string with_option_names(std::string text);

} // namespace unseen::app
