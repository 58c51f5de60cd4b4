// The rows of a switch distance table: from how far each pattern is invisible, by eccentricity.
#pragma once

#include <cstdint>
#include <map>

#include "fold/pattern_eye.h"

namespace unseen::perception {

// The switch distance of patterns by eccentricity, computed when they are first asked for. Where patterns are too many
// for the rows' numbers, begin again with coarser ones.
class SwitchDistances {
public:
    // `added`: rows that add() will ask for.
    SwitchDistances(const PatternLevels& levels, const Screen& screen, const CsfTable& csf, const FoldModel& model,
                    const Surround& surround, const BandElevation& masking, std::size_t bins, std::size_t added)
        : levels_(levels), screen_(screen), csf_(csf), model_(model), surround_(surround), masking_(masking),
          bands_(screen.highest_cpd, model, csf.samples().summation), bins_(bins), most_patterns_(last_row - added),
          discs_(pattern_luminance_count), eyes_(pattern_luminance_count) {
        begin();
    }

    std::uint16_t row(const Pattern& pattern) { // simplified; 0 where there is none left
        if (pattern.is_nothing()) return 0;
        if (const auto known = rows_.find(pattern); known != rows_.end()) return known->second;
        if (rows_.size() == most_patterns_) {
            has_too_few_ = true;
            return 0;
        }
        const auto row = static_cast<std::uint16_t>(rows_.size() + 1);
        rows_.emplace(pattern, row);
        pattern.is_strip ? add_strip(pattern) : add_patch(pattern);
        return row;
    }
    bool has_too_few() const { return has_too_few_; } // of what there is, nothing is to be used then
    // Forgets all rows. Ends well: at a coarseness of 256 each contrast is one of two, and there are no more than 16
    // luminances, 121 quarters and four ways to combine a typical and a largest contrast: 16,000 patches.
    void coarsen() {
        coarseness_ *= 2;
        begin();
    }
    // On the grid, and without bias that can nowhere be seen from as far as the rest.
    Pattern simplified(Pattern p) {
        p = rounded(p, coarseness_);
        if (p.bias == no_contrast || p.typical == no_contrast) return p;
        const Discs& tables = discs(p.luminance);
        const float* const typical = &tables.patches[static_cast<std::size_t>(p.typical) * bins_];
        bool is_needed = false;
        for_each_bias(p, [&](int contrast, float width) {
            const float* const from = &tables.areas[static_cast<std::size_t>(contrast) * bins_];
            for (std::size_t bin = 0; bin < bins_; ++bin) is_needed |= width * from[bin] > typical[bin];
        });
        if (is_needed) return p;
        p.bias = no_contrast;
        return rounded(p, coarseness_);
    }
    // A row of distances, in lengths of its own.
    std::uint16_t add(std::span<const float> distances, float length) {
        for (const float distance : distances)
            switch_distance_.push_back(std::min(distance / length, vdtree::DistanceCriterion::always_visible));
        return static_cast<std::uint16_t>(switch_distance_.size() / bins_ - 1);
    }
    std::span<const float> switch_distance(std::uint16_t row) const {
        return std::span(switch_distance_).subspan(row * bins_, bins_);
    }
    std::vector<float> take() { return std::move(switch_distance_); }

private:
    static constexpr std::size_t last_row = std::numeric_limits<std::uint16_t>::max();

    void begin() {
        rows_.clear();
        switch_distance_.assign(bins_, vdtree::DistanceCriterion::never_visible); // row 0: what changes nothing
        has_too_few_ = false;
    }

    const PatternEye& eye(int luminance, std::size_t bin) {
        auto& eyes = eyes_[static_cast<std::size_t>(luminance)];
        if (eyes.empty()) {
            const double cdm2 = levels_.luminance(luminance);
            const Dimming dimming(bands_, surround_, cdm2, screen_.highest_cpd, model_);
            for (std::size_t b = 0; b < bins_; ++b)
                eyes.emplace_back(csf_, static_cast<double>(b) * degrees_per_bin, cdm2, screen_, bands_, dimming,
                                  masking_, model_);
        }
        return eyes[bin];
    }

    struct Discs {
        std::vector<float> patches, areas; // [contrast * bins + bin], in radii
    };
    const Discs& discs(int luminance) {
        Discs& tables = discs_[static_cast<std::size_t>(luminance)];
        if (tables.patches.empty()) {
            for (int contrast = 0; contrast < pattern_contrast_count; ++contrast) {
                for (std::size_t bin = 0; bin < bins_; ++bin) {
                    tables.patches.push_back(
                        static_cast<float>(eye(luminance, bin).patch_distance(PatternLevels::contrast(contrast))));
                    tables.areas.push_back(
                        static_cast<float>(eye(luminance, bin).area_distance(PatternLevels::contrast(contrast))));
                }
            }
        }
        return tables;
    }

    void add_patch(const Pattern& p) {
        const std::size_t first = switch_distance_.size();
        switch_distance_.resize(first + bins_, 0);
        const Discs& tables = discs(p.luminance);
        const auto include = [&](const std::vector<float>& one, int contrast, float width) {
            const float* const from = &one[static_cast<std::size_t>(contrast) * bins_];
            for (std::size_t bin = 0; bin < bins_; ++bin)
                switch_distance_[first + bin] = std::max(switch_distance_[first + bin], width * from[bin]);
        };
        if (p.typical != no_contrast) {
            // The same light in a part half as wide has four times the contrast; but nowhere more than the largest.
            constexpr int per_halving = 2 * pattern_contrasts_per_octave;
            float width = 1;
            for (int contrast = std::min(p.typical, p.largest);;
                 contrast = std::min(contrast + per_halving, p.largest), width /= 2) {
                include(tables.patches, contrast, width);
                if (contrast == p.largest) break;
            }
        }
        if (p.bias != no_contrast)
            for_each_bias(p, [&](int contrast, float width) { include(tables.areas, contrast, width); });
        make_monotone(first);
    }

    // Calls f(contrast, width) for the mesh and for areas down to twice the node's width, at whole octaves.
    template <class F>
    static void for_each_bias(const Pattern& p, F&& f) {
        for (int quarters = p.quarters; quarters >= 4; quarters = (quarters - 1) / 4 * 4) {
            const int contrast = p.bias - (quarters * p.fading * pattern_contrasts_per_octave / 2 + 3) / 4;
            if (contrast >= 0) f(contrast, std::exp2(static_cast<float>(quarters) / 4));
        }
    }

    void add_strip(const Pattern& p) {
        const std::size_t first = switch_distance_.size();
        for (std::size_t bin = 0; bin < bins_; ++bin)
            switch_distance_.push_back(
                static_cast<float>(eye(p.luminance, bin).strip_distance(PatternLevels::contrast(p.largest), p.course)));
        make_monotone(first);
    }

    // The table's own rounding must not make anything grow with the eccentricity.
    void make_monotone(std::size_t first) {
        for (std::size_t i = first + 1; i < switch_distance_.size(); ++i)
            switch_distance_[i] = std::min(switch_distance_[i], switch_distance_[i - 1]);
    }

    const PatternLevels& levels_;
    const Screen& screen_;
    const CsfTable& csf_;
    const FoldModel& model_;
    const Surround surround_;
    const BandElevation& masking_;
    const PatternBands bands_;
    std::size_t bins_, most_patterns_;
    int coarseness_ = 1;
    bool has_too_few_ = false;
    std::vector<Discs> discs_;
    std::vector<std::vector<PatternEye>> eyes_; // by luminance; by bin
    std::map<Pattern, std::uint16_t> rows_;
    std::vector<float> switch_distance_;
};

} // namespace unseen::perception
