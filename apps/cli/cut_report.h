// What a simplification came to: JSON for programs, sentences for people.
#pragma once

#include <span>
#include <string>

#include <unseen/session/session.h>

#include "options.h"
#include "report.h"

namespace unseen::app {

// The keys that simplify and render report; draw_ms is NaN where nothing was drawn.
Json to_json(const session::Report& report, double draw_ms);

// "36,458 of 69,666 triangles (52%)"; the same after "kept".
std::string triangles_text(std::uint64_t triangles, std::uint64_t source_triangles);
std::string kept_text(std::uint64_t triangles, std::uint64_t source_triangles);
// Whether a difference is seen, and from where: "nobody sees a difference, looked at from 0.5 m or more".
std::string seen_from_text(const session::Report& report, const perception::Display& display);
// Who sees a difference, and from where: with the observer, the fold test that judges, and the conditions. `where`:
// "in this view".
std::string visibility_text(const session::Report& report, const session::Observer& observer,
                            const DisplayOptions& display, const std::string& where);
// What stands behind it: counts, times and effects.
void print_details(const session::Report& report, double draw_ms);

// Adds what a file became: "as" (model or scene), "tree" (where the first is from), and for a scene "objects" with name,
// triangles of the tree and of the cut, and "backdrop_triangles". `cuts`: by object.
void add_scene(Json& json, const session::Session& session, std::span<const vdtree::Cut> cuts);
// For a scene "a scene of 3 objects, before 2 parts of background"; for a model nothing.
void print_scene(const session::Session& session);

Json to_json(std::span<const session::Effect> effects);
Json passes_to_json(std::span<const session::Effect> passes);
void print(std::span<const session::Effect> effects);
void print_passes(std::span<const session::Effect> passes);

} // namespace unseen::app
