#include <unseen/session/request.h>

#include <algorithm>
#include <cmath>

#include <unseen/vdtree/internal/errors.h>

namespace unseen::session {
namespace {

bool is_positive(double value) { return value > 0 && std::isfinite(value); }

Result<void> validate_goal(const Request& r) {
    using Kind = Goal::Kind;
    const FoldTest test = r.fold_test.value_or(r.goal.kind == Kind::pixels ? FoldTest::extent : FoldTest::error);
    if (r.goal.kind == Kind::budget && r.goal.triangles == 0)
        return invalid_field("{request.goal.triangles} must be 1 or more.");
    if (r.goal.fill && r.goal.kind != Kind::budget)
        return invalid_field("{request.goal.fill} needs {request.goal.triangles}.");
    if (!is_positive(r.goal.cost) || !(r.goal.summed_cost >= 0 && std::isfinite(r.goal.summed_cost)))
        return invalid_field("{request.goal.cost} must be above 0 and finite.");
    if (r.goal.kind == Kind::pixels && !is_positive(r.goal.tolerance_px))
        return invalid_field("{request.goal.pixels} must be above 0 and finite.");
    if (r.goal.kind == Kind::pixels && is_perceptual(test))
        return invalid_field(
            "{request.goal.pixels} needs {request.fold_test = }extent or displacement: {} knows no pixels.",
            {name_of(test)});
    if (r.goal.kind == Kind::quality && !is_perceptual(test))
        return invalid_field("{request.fold_test = }{} cannot tell what is imperceptible: ask for "
                             "{request.goal.triangles} or {request.goal.pixels}.",
                             {name_of(test)});
    return {};
}

constexpr QualityFacts all_qualities[] = {
    {Quality::invisible, "invisible", "nobody sees a difference, by the model (default)", 1, 1},
    {Quality::lossless, "lossless", "hardly anybody does who compares", 3, 6},
    {Quality::good, "good", "small differences, if one looks for them", 4, 9},
    {Quality::draft, "draft", "plain differences that do not disturb", 9, 17},
};

} // namespace

std::span<const QualityFacts> qualities() noexcept { return all_qualities; }
const QualityFacts& facts_of(Quality quality) noexcept {
    return *std::ranges::find(all_qualities, quality, &QualityFacts::quality);
}

const QualityFacts* named_quality(const Goal& goal) noexcept {
    if (goal.kind != Goal::Kind::quality) return nullptr;
    for (const QualityFacts& facts : all_qualities) {
        const Goal named = Goal::quality(facts.quality);
        if (goal.cost == named.cost && goal.summed_cost == named.summed_cost) return &facts;
    }
    return nullptr;
}

bool goes_by_sum(const Request& r) noexcept {
    return (r.goal.kind == Goal::Kind::budget || (r.goal.kind == Goal::Kind::quality && r.goal.summed_cost > 0)) &&
           r.order == Order::sum && r.fold_test.value_or(FoldTest::error) == FoldTest::error;
}

Result<void> validate(const Request& r) {
    if (r.shown.size() > 1 && r.purpose != Purpose::mesh)
        return invalid_field("{request.shown} is of several views: set {request.purpose} = mesh.");
    if (const auto goal = validate_goal(r); !goal) return goal;
    if (r.milliseconds && !(*r.milliseconds >= 0 && std::isfinite(*r.milliseconds)))
        return invalid_field("{request.milliseconds} must be 0 or more, and finite.");
    if (r.milliseconds && r.goal.kind == Goal::Kind::full)
        return invalid_field("{request.milliseconds} has no meaning for the full model.");
    if (!(r.hysteresis >= 1 && r.hysteresis <= 2)) return invalid_field("{request.hysteresis} must be from 1 to 2.");
    return {};
}

} // namespace unseen::session
