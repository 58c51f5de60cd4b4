// The judge's tables in render's terms.
#pragma once

#include <unseen/perception/judge_tables.h>
#include <unseen/render/internal/elevation.h>
#include <unseen/render/internal/visibility_passes.h>

namespace unseen::session {

render::VisibilityTables visibility_tables(const perception::JudgeTables& tables);
render::ElevationTables elevation_tables(const perception::Rpg99Tables& tables);

} // namespace unseen::session
