// Makes the tables that judges go by (<unseen/vdtree/internal/judge_tables.h>).
#pragma once

#include <unseen/perception/judge.h>
#include <unseen/vdtree/internal/judge_tables.h>

namespace unseen::perception {

// For references of this size with luminances between these, cd/m2. Fails like Judge::create on invalid options, on a
// size below 1x1, and on luminances that are negative, not finite or do not ascend. Cost: 1 to 5 ms, with a
// gaze up to 40 and some nanoseconds a pixel.
Result<JudgeTables> judge_tables(int width, int height, float darkest_cdm2, float brightest_cdm2,
                                 const JudgeOptions& options);

// For pictures of this width. Fails like rpg99_map(), and on widths below 1.
Result<Rpg99Tables> rpg99_tables(int width, double field_degrees);

} // namespace unseen::perception
