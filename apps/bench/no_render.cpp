// The benchmarks that draw, in a build without OpenGL: they say so.
#include "bench_tools.h"
#include "benches.h"

namespace unseen::app {
namespace {

BenchReport no_pictures() {
    throw BenchFailure{{ErrorCode::unsupported,
                        "This build cannot judge pictures, for it was made without OpenGL; configure it with "
                        "-DUNSEEN_BUILD_RENDER=ON."}};
}

} // namespace

BenchReport bench_perception(const PerceptionOptions&) { return no_pictures(); }
BenchReport bench_lod(const BenchOptions&) { return no_pictures(); }
BenchReport bench_quality(const QualityOptions&) { return no_pictures(); }
BenchReport bench_fit(const FitOptions&) { return no_pictures(); }
BenchReport bench_scenes(const ScenesOptions&) { return no_pictures(); }
BenchReport bench_selection(const SelectionOptions&) { return no_pictures(); }
BenchReport bench_accuracy(const AccuracyOptions&) { return no_pictures(); }
std::vector<std::string> accuracy_axis_keys() { return {}; }
std::string accuracy_picture_name(const std::string&) { return {}; }
std::string corner_sheet_name(const std::string&) { return {}; }
std::vector<std::string> fit_factors() { return {}; }

} // namespace unseen::app
