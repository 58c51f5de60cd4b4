// What a simplification came to: JSON for programs, a table for people.
#pragma once

#include <span>

#include <session/simplification.h>

#include "report.h"

namespace unseen::app {

// The keys that simplify and render report; draw_ms is NaN where nothing was drawn.
Json to_json(const session::Report& report, double draw_ms);
void print(const session::Report& report, double draw_ms);

Json to_json(std::span<const session::Effect> effects);
void print(std::span<const session::Effect> effects);

} // namespace unseen::app
