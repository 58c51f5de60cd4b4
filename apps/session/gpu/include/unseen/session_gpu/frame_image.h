// Drawn frames as images: code values for people, luminance for judging.
#pragma once

#include <unseen/perception/display.h>
#include <unseen/perception/image.h>
#include <unseen/render/renderer.h>

namespace unseen::session {

// Colour encoded for the display, in code values.
perception::Image code_image(const render::Frame& frame, const perception::Display& display);
// Luminance as the display shows it, in cd/m2.
perception::Image luminance_image(const render::Frame& frame, const perception::Display& display);

} // namespace unseen::session
