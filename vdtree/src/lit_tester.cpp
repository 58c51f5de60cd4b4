#include "lit_tester.h"

namespace unseen::vdtree {

LitTester::LitTester(const VertexTree& tree, const LitClasses& classes, std::span<const float> reach, std::size_t bins)
    : tree_(tree), cones_(classes.bounds->cones().data()), reach_(reach), bins_(bins), silhouette_row_(classes.silhouette),
      black_(static_cast<float>(classes.levels.black() / classes.levels.span())) {
    for (std::size_t i = 0; i < contrasts_.size(); ++i) contrasts_[i] = static_cast<float>(ContrastClasses::contrast_of_index(i));
    for (std::size_t i = 0; i < luminances_.size(); ++i)
        luminances_[i] = static_cast<float>(classes.levels.luminance_of_index(i) / classes.levels.span());
    constexpr float rounded = 1 - 1e-5f; // of a bucket's start
    const auto fill = [&](auto& guesses, const auto& edges, float scale, std::uint32_t least_bits, unsigned shift) {
        std::size_t at = 0;
        for (std::size_t i = 0; i < guesses.size(); ++i) {
            while (at + 1 < edges.size() && edges[at] < bucket_start(i, least_bits, shift) * scale * rounded) ++at;
            guesses[i] = static_cast<std::uint8_t>(at);
        }
    };
    fill(contrast_guesses_, contrasts_, 1, least_contrast_bits, contrast_shift);
    fill(luminance_guesses_, luminances_, luminances_[0], 127u << 23, luminance_shift);
    reach_guesses_.resize(luminances_.size() * bins_ * reach_guesses);
    for (std::size_t l = 0; l < luminances_.size(); ++l)
        for (std::size_t bin = 0; bin < bins_; ++bin) {
            std::size_t at = 0;
            for (std::size_t i = 0; i < reach_guesses; ++i) {
                const float least = bucket_start(i, least_reach_bits, reach_shift) * rounded;
                while (i > 0 && at + 1 < contrasts_.size() && !unfolds_at(l, at, least, bin)) ++at;
                reach_guesses_[(l * bins_ + bin) * reach_guesses + i] = static_cast<std::uint8_t>(at);
            }
        }
}

void LitTester::find_rows(LitFindings& lit) const {
    find_ranges(lights_, lit.ranges);
    alignas(64) float contrast[kernel_lanes];
    for (std::size_t i = 0; i < kernel_lanes; ++i)
        contrast[i] = (lit.ranges.hi[i] - lit.ranges.lo[i]) / (lit.ranges.hi[i] + lit.ranges.lo[i] + 2 * black_);
    for (std::size_t i = 0; i < kernel_lanes; ++i) {
        lit.contrast[i] = contrast_index(contrast[i]);
        lit.luminance[i] = luminance_index(lit.ranges.hi[i]);
        lit.row[i] = row(lit.luminance[i], lit.contrast[i]);
    }
}

std::int32_t LitTester::leave_room(std::size_t lane, bool is_unfolded, float gap, std::size_t bin, LitFindings& lit) const {
    const std::size_t contrast = lit.contrast[lane], own = lit.luminance[lane];
    // Any class of luminance where that changes nothing, else the next one or the same.
    std::size_t luminance = is_unfolded ? 0 : luminances_.size() - 1;
    if (luminance != own && unfolds_at(luminance, contrast, gap, bin) != is_unfolded) {
        const std::size_t next = is_unfolded ? own - 1 : own + 1;
        luminance = unfolds_at(next, contrast, gap, bin) == is_unfolded ? next : own;
    }
    const std::size_t first = first_to_unfold(luminance, gap, bin);
    const std::size_t there = is_unfolded ? contrast - lights_share(contrast - std::min(first, contrast))
                                          : contrast + lights_share(std::max(first, contrast + 1) - 1 - contrast);
    lit.slack[lane] = length_ * motion_within(lane, is_unfolded, luminance, there, lit);
    return row(luminance, there);
}

// How far the lights may move with the contrast at most that of its class (unfolded: more than that of the class below) and
// the luminance likewise.
float LitTester::motion_within(std::size_t i, bool is_unfolded, std::size_t luminance, std::size_t contrast, const LitFindings& lit) const {
    const LitBatch& at = lit.ranges;
    const float jump = at.jump[i], hi = at.hi[i], lo = at.lo[i], mean = hi + lo + 2 * black_;
    float limit = 0, left = never;
    if (is_unfolded) {
        if (contrast > 0) limit = contrasts_[contrast - 1];
        left = hi - lo - jump - limit * (mean + 2 * jump);
    } else if (contrast + 1 < contrasts_.size()) {
        limit = contrasts_[contrast];
        left = limit * (mean - 2 * jump) - (hi - lo) - jump;
    }
    float room = never; // of the brightest luminance
    if (is_unfolded && luminance > 0) room = hi + black_ - luminances_[luminance - 1];
    else if (!is_unfolded && luminance + 1 < luminances_.size()) room = luminances_[luminance] - (hi + black_);
    left -= estimate_rounding;
    room -= jump + estimate_rounding;
    if (!(left > 0 && room > 0)) return 0;

    const float full_rate = at.full_rate[i] * (1 + limit), fine_rate = at.fine_rate[i] + limit * at.fine_sum_rate[i];
    const float fine_cap = std::min(at.fine_cap[i], at.cap[i]);
    float motion = left >= fine_rate * fine_cap ? fine_cap : left / fine_rate;
    if (motion == fine_cap) motion += full_rate > 0 ? (left - fine_rate * fine_cap) / full_rate : never;
    if (at.rise_rate[i] * motion > room) motion = room / at.rise_rate[i];
    return std::min(motion, at.cap[i]) * (1 - slack_rounding);
}

} // namespace unseen::vdtree
