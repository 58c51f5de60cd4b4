#include "cut/kernel/lit_tester.h"

namespace unseen::vdtree {

// Loops over all lanes are such as compilers make vectors of.

namespace {

template <class Values>
UNSEEN_INLINE auto at(const Values& values, std::int32_t i) {
    return values[static_cast<std::size_t>(i)];
}

} // namespace

LitTester::LitTester(const VertexTree& tree, const LitClasses& classes, std::span<const float> switch_distance,
                     std::size_t bins)
    : tree_(tree), cones_(classes.bounds->cones().data()),
      radii_(classes.bounds->radii().empty() ? nullptr : classes.bounds->radii().data()),
      switch_distance_(switch_distance), bins_(static_cast<std::int32_t>(bins)), silhouette_row_(classes.silhouette),
      black_(static_cast<float>(classes.scale.offset / classes.scale.span)) {
    const ContrastClasses levels(classes.scale);
    for (std::size_t i = 0; i < contrasts_.size(); ++i)
        contrasts_[i] = static_cast<float>(ContrastClasses::contrast_of_index(i));
    for (std::size_t i = 0; i < luminances_.size(); ++i)
        luminances_[i] = static_cast<float>(levels.level(1 + i * ContrastClasses::contrast_count) / classes.scale.span);
    fill_guesses();
}

void LitTester::fill_guesses() {
    constexpr float rounded = 1 - 1e-5f; // of a bucket's start
    const auto fill = [&](auto& guesses, const auto& edges, float scale, std::int32_t least_bits, unsigned shift) {
        std::int32_t edge = 0;
        for (std::size_t i = 0; i < guesses.size(); ++i) {
            const float least = bucket_start(static_cast<std::int32_t>(i), least_bits, shift) * scale * rounded;
            while (edge + 1 < static_cast<std::int32_t>(edges.size()) && at(edges, edge) < least) ++edge;
            guesses[i] = edge;
        }
    };
    fill(contrast_guesses_, contrasts_, 1, least_contrast_bits, contrast_shift);
    fill(luminance_guesses_, luminances_, luminances_[0], least_luminance_bits, luminance_shift);
    distance_guesses_.reserve(static_cast<std::size_t>(luminance_count * bins_ * distance_guess_count));
    for (std::int32_t luminance = 0; luminance < luminance_count; ++luminance)
        for (std::int32_t bin = 0; bin < bins_; ++bin) {
            std::int32_t first = 0;
            for (std::int32_t i = 0; i < distance_guess_count; ++i) {
                const float least = bucket_start(i, least_distance_bits, distance_shift) * rounded;
                while (i > 0 && first + 1 < contrast_count &&
                       !(least < at(switch_distance_, row(luminance, first) * bins_ + bin)))
                    ++first;
                distance_guesses_.push_back(first);
            }
        }
}

// The classes as ContrastClasses has them, by their edges: a guess, and a step or two from there.
UNSEEN_INLINE void LitTester::find_classes(LitFindings& lit) const {
    const LitBatch& batch = lit.ranges;
    alignas(64) float contrast[kernel_lanes], luminance[kernel_lanes], share[kernel_lanes];
    for (std::size_t i = 0; i < kernel_lanes; ++i) {
        contrast[i] = (batch.hi[i] - batch.lo[i]) / (batch.hi[i] + batch.lo[i] + 2 * black_);
        luminance[i] = batch.hi[i] + black_;
        share[i] = luminance[i] / luminances_[0];
    }
    alignas(64) std::int32_t contrast_bits[kernel_lanes], share_bits[kernel_lanes];
    std::memcpy(contrast_bits, contrast, sizeof contrast);
    std::memcpy(share_bits, share, sizeof share);
    for (std::size_t i = 0; i < kernel_lanes; ++i) {
        lit.contrast[i] =
            at(contrast_guesses_, bucket(contrast_bits[i], least_contrast_bits, contrast_shift, contrast_guess_count));
        lit.luminance[i] =
            at(luminance_guesses_, bucket(share_bits[i], least_luminance_bits, luminance_shift, luminance_guess_count));
    }
    for (std::int32_t moved = 1; moved;) {
        moved = 0;
        for (std::size_t i = 0; i < kernel_lanes; ++i) {
            const std::int32_t c =
                (lit.contrast[i] < contrast_count - 1) & !(contrast[i] <= at(contrasts_, lit.contrast[i])); // NaN too
            const std::int32_t l =
                (lit.luminance[i] < luminance_count - 1) & !(luminance[i] <= at(luminances_, lit.luminance[i]));
            lit.contrast[i] += c;
            lit.luminance[i] += l;
            moved |= c | l;
        }
    }
    for (std::size_t i = 0; i < kernel_lanes; ++i) lit.row[i] = row(lit.luminance[i], lit.contrast[i]);
}

UNSEEN_INLINE void LitTester::find_room(LitFindings& lit) const {
    const LitBatch& batch = lit.ranges;
    const auto switch_distance =
        [&](std::int32_t luminance, std::int32_t contrast, std::int32_t bin)
            UNSEEN_INLINE_LAMBDA { return at(switch_distance_, row(luminance, contrast) * bins_ + bin); };
    // Any class of luminance where that changes nothing, else the next one or the same.
    alignas(64) std::int32_t luminance[kernel_lanes], first[kernel_lanes], there[kernel_lanes], gap_bits[kernel_lanes];
    for (std::size_t i = 0; i < kernel_lanes; ++i) {
        const std::int32_t unfolded = lit.is_unfolded[i], own = lit.luminance[i];
        const std::int32_t last = unfolded ? 0 : luminance_count - 1, next = own + (own < last   ? 1
                                                                                    : own > last ? -1
                                                                                                 : 0);
        const std::int32_t at_last = lit.gap[i] < switch_distance(last, lit.contrast[i], lit.bin[i]);
        const std::int32_t at_next = lit.gap[i] < switch_distance(next, lit.contrast[i], lit.bin[i]);
        luminance[i] = at_last == unfolded ? last : at_next == unfolded ? next : own;
    }
    std::memcpy(gap_bits, lit.gap, sizeof gap_bits);
    for (std::size_t i = 0; i < kernel_lanes; ++i) {
        const std::int32_t guess = bucket(gap_bits[i], least_distance_bits, distance_shift, distance_guess_count);
        first[i] = at(distance_guesses_, (luminance[i] * bins_ + lit.bin[i]) * distance_guess_count + guess);
    }
    for (std::int32_t moved = 1; moved;) {
        moved = 0;
        for (std::size_t i = 0; i < kernel_lanes; ++i) {
            const float reached = switch_distance(luminance[i], std::min(first[i], contrast_count - 1), lit.bin[i]);
            const std::int32_t step = (first[i] < contrast_count) & !(lit.gap[i] < reached);
            first[i] += step;
            moved |= step;
        }
    }
    // Most of the way to the limit, in classes, is for the lights; the rest is for the eye.
    const auto lights_share = [](std::int32_t classes) UNSEEN_INLINE_LAMBDA { return classes - classes / 8; };
    for (std::size_t i = 0; i < kernel_lanes; ++i) {
        const std::int32_t own = lit.contrast[i];
        const std::int32_t below = own - std::min(first[i], own), above = std::max(first[i], own + 1) - 1 - own;
        there[i] = lit.is_unfolded[i] ? own - lights_share(below) : own + lights_share(above);
        lit.farthest_row[i] = row(luminance[i], there[i]);
    }

    // How far the lights may move with the contrast at most that of its class (unfolded: more than that of the class
    // below) and the luminance likewise.
    for (std::size_t i = 0; i < kernel_lanes; ++i) {
        const bool unfolded = lit.is_unfolded[i] != 0;
        const std::int32_t contrast = there[i];
        const bool has_limit = unfolded ? contrast > 0 : contrast + 1 < contrast_count;
        const float edge = at(contrasts_, std::max(contrast - (unfolded ? 1 : 0), 0)), limit = has_limit ? edge : 0.0f;
        const float jump = batch.jump[i], hi = batch.hi[i], lo = batch.lo[i], mean = hi + lo + 2 * black_;
        float left =
            unfolded ? hi - lo - jump - limit * (mean + 2 * jump) : limit * (mean - 2 * jump) - (hi - lo) - jump;
        left = unfolded || has_limit ? left - estimate_rounding : never;
        // Likewise for the brightest luminance.
        const bool has_room = unfolded ? luminance[i] > 0 : luminance[i] + 1 < luminance_count;
        const float brightest = at(luminances_, std::max(luminance[i] - (unfolded ? 1 : 0), 0));
        const float room =
            has_room ? (unfolded ? hi + black_ - brightest : brightest - (hi + black_)) - (jump + estimate_rounding)
                     : never;

        const float rough_rate = batch.rough_rate[i] + limit * batch.full_rate[i],
                    fine_rate = batch.fine_rate[i] + limit * batch.fine_sum_rate[i];
        const float fine_cap = std::min(batch.fine_cap[i], batch.cap[i]);
        const float beyond = rough_rate > 0 ? (left - fine_rate * fine_cap) / rough_rate : never;
        float motion = left >= fine_rate * fine_cap ? fine_cap + beyond : left / fine_rate;
        motion = batch.rise_rate[i] * motion > room ? room / batch.rise_rate[i] : motion;
        motion = std::min(motion, batch.cap[i]) * (1 - slack_rounding);
        lit.slack[i] = left > 0 && room > 0 && motion > 0 ? length_ * motion : 0.0f;
    }
}

UNSEEN_AVX2 void LitTester::find_classes_avx2(LitFindings& lit) const { find_classes(lit); }
UNSEEN_AVX2 void LitTester::find_room_avx2(LitFindings& lit) const { find_room(lit); }

// Neither has fused operations, so both give the same bits.
void LitTester::find_rows(LitFindings& lit) const {
    find_ranges(lights_, lit.ranges);
    if (has_avx2()) find_classes_avx2(lit);
    else find_classes(lit);
}

void LitTester::leave_room(LitFindings& lit) const {
    if (has_avx2()) find_room_avx2(lit);
    else find_room(lit);
}

} // namespace unseen::vdtree
