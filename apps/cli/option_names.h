// The options of the command for the fields that messages of the libraries name.
#pragma once

#include <string>

#include <unseen/vdtree/result.h>

namespace unseen::app {

// "request.shown and scene.lights exclude each other" -> "--visibility picture and --lights exclude each other".
std::string with_option_names(const Message& message);

} // namespace unseen::app
