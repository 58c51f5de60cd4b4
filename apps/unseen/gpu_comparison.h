// Judging on the GPU; in a build without OpenGL, why there is none.
#pragma once

#include <optional>
#include <string>

#include <unseen/perception/judge.h>

namespace unseen::app {

struct GpuComparison {
    perception::Judgement judgement;
    std::optional<perception::Image> threshold_map; // where it is wanted
    std::string renderer;                           // which GPU it was
};
Result<GpuComparison> compare_on_gpu(const perception::Image& reference, const perception::Image& test,
                                     const perception::JudgeOptions& options, bool wants_threshold_map);

} // namespace unseen::app
