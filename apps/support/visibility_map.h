// What a judge saw, as a picture for people.
#pragma once

#include <unseen/perception/image.h>

#include "colour_bar.h"

namespace unseen::app {

// Invisible differences in blues, visible ones from yellow (just so) to red (8 times that and more). Code values.
perception::Image visibility_map(const perception::Image& visibility);

// Of these colours: thresholds of visibility.
ColourBar visibility_bar();

} // namespace unseen::app
