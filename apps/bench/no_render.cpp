// The benchmarks that draw, in a build without OpenGL: they say so.
#include "accuracy_bench.h"
#include "fit_bench.h"
#include "lod_bench.h"
#include "perception_bench.h"
#include "points_bench.h"
#include "scenes_bench.h"
#include "selection_bench.h"

namespace unseen::app {
namespace {

Error no_pictures() {
    return {ErrorCode::unsupported,
            "This build cannot judge pictures, for it was made without OpenGL; configure it with "
            "-DUNSEEN_BUILD_RENDER=ON."};
}

} // namespace

Result<PerceptionBenchResult> bench_perception(const PerceptionBenchOptions&) { return no_pictures(); }
Result<LodBenchResult> bench_lod(const std::vector<std::string>&, int) { return no_pictures(); }
Result<PointsBenchResult> bench_points(const PointsBenchOptions&) { return no_pictures(); }
Result<FitBenchResult> bench_fit(const FitBenchOptions&) { return no_pictures(); }
Result<ScenesBenchResult> bench_scenes(const ScenesBenchOptions&) { return no_pictures(); }
Result<SelectionBenchResult> bench_selection(const SelectionBenchOptions&) { return no_pictures(); }
Result<AccuracyBenchResult> bench_accuracy(const AccuracyBenchOptions&) { return no_pictures(); }
std::string to_csv(const AccuracyBenchResult&) { return {}; }
std::string to_html(const AccuracyBenchResult&) { return {}; }
std::vector<std::string> accuracy_axis_keys() { return {}; }
std::string accuracy_picture_name(const std::string&) { return {}; }
Result<void> write_pictures(const AccuracyBenchResult&, const std::string&) { return no_pictures(); }
std::vector<std::string> fit_factors() { return {}; }

} // namespace unseen::app
