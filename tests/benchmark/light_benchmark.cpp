// Lights that move while the eye stands still: what one frame of the cut takes with its index buffer, 100,000 triangles
// active or half of the mesh where it is smaller.
#include <benchmark/benchmark.h>

#include <memory>

#include <unseen/perception/criterion.h>
#include <unseen/vdtree/cut.h>

#include "bench_mesh.h"
#include "followed_frames.h"
#include "turning_light.h"

namespace unseen::bench {
namespace {

using app::lighting_at;
using app::TurningLight;
using vdtree::Cut;

struct Subject {
    explicit Subject(TurningLight kind_)
        : kind(kind_), bounds(std::make_shared<vdtree::LightBounds>(*vdtree::LightBounds::measure(tree()))),
          criterion(make()) {
        threshold = threshold_of_much(tree(), [&](Cut& cut, float at) { return follow(cut, 0, at); });
    }
    vdtree::AdjustStats follow(Cut& cut, double degrees) const { return follow(cut, degrees, threshold); }
    vdtree::AdjustStats follow(Cut& cut, double degrees, float at) const {
        vdtree::Viewpoint viewpoint = perception::viewpoint_of(tree(), orbit(0), {}, {}, false);
        viewpoint.lighting = lighting_at(tree(), kind, degrees);
        vdtree::FollowOptions following;
        following.threshold = at;
        return *cut.follow(criterion, viewpoint, following);
    }

    TurningLight kind;
    std::shared_ptr<const vdtree::LightBounds> bounds;
    vdtree::DistanceCriterion criterion;
    float threshold = 1;

private:
    vdtree::DistanceCriterion make() const {
        perception::FoldTestOptions options;
        const glm::dvec3 eye = perception::viewpoint_of(tree(), orbit(0), {}).eye;
        options.scene = perception::lit_scene(tree(), *bounds, lighting_at(tree(), kind, 0), eye, 0.2f);
        return *perception::lit_distances(tree(), bounds, orbit(0), options);
    }
};

const Subject& subject(TurningLight kind) {
    static const Subject directional(TurningLight::directional), point(TurningLight::point),
        highlights(TurningLight::highlights);
    return kind == TurningLight::directional ? directional : kind == TurningLight::point ? point : highlights;
}

void moving_light(benchmark::State& state, TurningLight kind) {
    const Subject& s = subject(kind);
    follow_turns(state, tree(), 20, [&](Cut& cut, double degrees) { return s.follow(cut, degrees); });
}
BENCHMARK_CAPTURE(moving_light, directional, TurningLight::directional)
    ->ArgName("tenth_degrees")
    ->Arg(1)
    ->Arg(10)
    ->Arg(50)
    ->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(moving_light, point, TurningLight::point)
    ->ArgName("tenth_degrees")
    ->Arg(1)
    ->Arg(10)
    ->Arg(50)
    ->Unit(benchmark::kMicrosecond);
BENCHMARK_CAPTURE(moving_light, highlights, TurningLight::highlights)
    ->ArgName("tenth_degrees")
    ->Arg(1)
    ->Arg(10)
    ->Arg(50)
    ->Unit(benchmark::kMicrosecond);

void light_bounds(benchmark::State& state) {
    for (auto _ : state) benchmark::DoNotOptimize(vdtree::LightBounds::measure(tree()));
}
BENCHMARK(light_bounds)->Unit(benchmark::kMillisecond);

} // namespace
} // namespace unseen::bench
