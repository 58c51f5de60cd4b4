// The fold test by errors in distance form: a switch distance table for patches and for strips, and each node's rows.
#include "fold/error_distances.h"

#include <unordered_map>

#include <unseen/perception/internal/chroma.h>

#include "fold/pattern_eye.h"

namespace unseen::perception {
namespace {

using vdtree::DistanceCriterion;
using vdtree::NodeId;

// The switch distance of patterns by eccentricity, computed when they are first asked for. Where patterns are too many
// for the rows' numbers, begin again with coarser ones.
class SwitchDistances {
public:
    // `added`: rows that add() will ask for.
    SwitchDistances(const PatternLevels& levels, const Screen& screen, const CsfTable& csf, const FoldModel& model,
                    const Surround& surround, std::size_t bins, std::size_t added)
        : levels_(levels), screen_(screen), csf_(csf), model_(model), surround_(surround),
          bands_(pattern_bands(screen.highest_cpd, model, csf.samples().summation)), bins_(bins),
          most_patterns_(last_row - added), discs_(pattern_luminance_count), eyes_(pattern_luminance_count) {
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
            const Dimming dimming(*bands_, surround_, cdm2, screen_.highest_cpd, model_);
            for (std::size_t b = 0; b < bins_; ++b)
                eyes.emplace_back(csf_, static_cast<double>(b) * degrees_per_bin, cdm2, screen_, *bands_, dimming,
                                  model_);
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

    // Calls f(contrast, width) for the mesh and for areas down to twice the node's width, at whole octaves. No disc has
    // more of the mesh in it than one that all of the mesh fills, and what lies in a narrower one is seen no less.
    template <class F>
    void for_each_bias(const Pattern& p, F&& f) const {
        const float filled = static_cast<float>(surround_.compactness) * std::exp2(static_cast<float>(p.quarters) / 4);
        for (int quarters = p.quarters; quarters >= 4; quarters = (quarters - 1) / 4 * 4) {
            const int contrast = p.bias - (quarters * p.fading * pattern_contrasts_per_octave / 2 + 3) / 4;
            if (contrast >= 0) f(contrast, std::min(std::exp2(static_cast<float>(quarters) / 4), filled));
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
    const std::shared_ptr<const PatternBands> bands_;
    std::size_t bins_, most_patterns_;
    int coarseness_ = 1;
    bool has_too_few_ = false;
    std::vector<Discs> discs_;
    std::vector<std::vector<PatternEye>> eyes_; // by luminance; by bin
    std::unordered_map<Pattern, std::uint16_t, PatternHash> rows_;
    std::vector<float> switch_distance_;
};

// A pattern of a width, and its row of the table.
struct ShownFold {
    Pattern pattern;
    float length = 0; // mesh units
    std::uint16_t row = 0;
};
struct ShownFolds { // by interior node
    std::vector<ShownFold> patches, strips;
};

// Octaves of contrast that a small part of a patch may have over all of it: sharper ones count as this, a sixteenth of
// the width. They are rare, and each octave is more rows.
constexpr int steepest_spike = 8 * pattern_contrasts_per_octave;

// An outline that moves by such a share of the mesh's radius is that of a part, which vanishes as a whole.
constexpr float whole_part = 0.125f;

// The widest mesh there can be, in widths of a node: also where nodes have none.
constexpr float widest = 1e9f;

// By how much the one must be wider to be seen from as far as the other everywhere.
float shortfall(const SwitchDistances& switch_distances, const ShownFold& a, const ShownFold& b) {
    constexpr float infinity = std::numeric_limits<float>::infinity();
    if (b.row == 0) return 1;
    if (a.row == b.row) return a.length > 0 ? std::max(b.length / a.length, 1.0f) : b.length > 0 ? infinity : 1;
    const std::span<const float> of_a = switch_distances.switch_distance(a.row),
                                 of_b = switch_distances.switch_distance(b.row);
    float factor = 0;
    for (std::size_t bin = 0; bin < of_a.size(); ++bin) {
        if (!(of_b[bin] > 0)) continue;
        if (!(of_a[bin] > 0)) return infinity;
        factor = std::max(factor, b.length > 0 ? b.length * of_b[bin] / (a.length * of_a[bin]) : 0.0f);
    }
    constexpr float rounding = 4e-6f; // of the products, when the criterion is checked
    return std::max(factor * (1 + rounding), 1.0f);
}

// From how far it is seen, in all.
float weight(const SwitchDistances& switch_distances, const ShownFold& shown) {
    float sum = 0;
    const std::span<const float> switch_distance = switch_distances.switch_distance(shown.row);
    for (std::size_t bin = 0; bin < switch_distance.size(); bin += 8)
        sum += std::log2(1 + std::max(switch_distance[bin], 0.0f) * shown.length);
    return sum;
}

// Makes `a` be seen from as far as `b`: wider, or of more contrast, whichever adds less.
void cover(SwitchDistances& switch_distances, ShownFold& a, const ShownFold& b) {
    if (a.row == 0) {
        if (b.row != 0) a = {b.pattern, std::max(a.length, b.length), b.row};
        return;
    }
    if (a.row == b.row) a.length = std::max(a.length, b.length);
    const float factor = shortfall(switch_distances, a, b);
    if (factor <= 1) return;
    ShownFold wider = a, richer = a;
    wider.length *= factor;
    richer.pattern = above(a.pattern, b.pattern);
    richer.length = std::max(a.length, b.length);
    richer.row = switch_distances.row(richer.pattern);
    // Biases of different widths are told at different octaves.
    richer.length *= std::max(shortfall(switch_distances, richer, a), shortfall(switch_distances, richer, b));
    if (!std::isfinite(wider.length) && !std::isfinite(richer.length)) {
        richer.pattern.fading = 0; // then the larger bias is above both everywhere
        richer.length = std::max(a.length, b.length);
        richer.row = switch_distances.row(richer.pattern);
    }
    const bool is_wider_less =
        !std::isfinite(richer.length) || weight(switch_distances, wider) <= weight(switch_distances, richer);
    a = std::isfinite(wider.length) && is_wider_less ? wider : richer;
}

// For a textured tree: by how much the light of a ring's vertices differs where the texture is brightest. What is moved
// of the texture is measured.
double spread_of_vertices(const vdtree::SoundTree& tree, NodeId node) {
    constexpr float least_texture = 1.0f / 64; // that tells the vertices' luminance well
    const vdtree::LuminanceRange drawn = tree.ring_luminance()[node], texture = tree.ring_texture()[node];
    if (!(texture.hi > 0)) return 0;
    const NodeId around = node > 0 ? tree.parents()[node] : node;
    const float darkest = texture.lo >= least_texture ? drawn.lo / texture.lo
                                                      : vdtree::LuminanceRange(tree.support_luminance()[around]).lo;
    return static_cast<double>(std::max(drawn.hi - darkest * texture.hi, 0.0f));
}

// Makes the patterns of single nodes.
class PatternFinder {
public:
    PatternFinder(const vdtree::SoundTree& tree, float own_colours, const FoldTestOptions& options, const CsfTable& csf,
                  double highest_cpd, SwitchDistances& switch_distances)
        : tree_(tree), levels_(options.display), switch_distances_(switch_distances),
          darkest_(levels_.in_cdm2(options.scene.darkest)), brightest_(levels_.in_cdm2(options.scene.brightest)),
          colour_(levels_.difference_in_cdm2(std::max(options.scene.colour, own_colours))),
          object_radius_(tree.support_spheres()[vdtree::VertexTree::root()].radius) {
        const vdtree::LuminanceRange all = tree.ring_luminance()[vdtree::VertexTree::root()];
        whole_ = levels_.luminance_level(levels_.in_cdm2(static_cast<double>(all.lo + all.hi) / 2));
        whole_peak_ = csf.peak_sensitivity(Degrees(0), Luminance(levels_.luminance(whole_))) *
                      summation_gain(CyclesPerDegree(highest_cpd), disc(180), csf.samples().summation);
    }

    ShownFold patch(const LitErrors& lit, NodeId node) const {
        const FoldError& error = lit.errors[node];
        const vdtree::LuminanceRange range = lit.tree->ring_luminance()[node];
        const double middle = (levels_.in_cdm2(range.lo) + levels_.in_cdm2(range.hi)) / 2;
        const double moved = moved_light(lit, node);
        ShownFold patch;
        Pattern& pattern = patch.pattern;
        pattern.luminance = levels_.luminance_level(middle);
        pattern.largest = levels_.contrast_level(change(node, error.luminance, moved, error.distance), middle);
        const double shift = factors::amplitude_of_shift_mean * static_cast<double>(error.mean_distance);
        const int typical = levels_.contrast_level(change(node, error.wide_luminance, moved, shift), middle);
        if (pattern.largest != no_contrast)
            pattern.typical = std::clamp(typical, std::max(pattern.largest - steepest_spike, 0), pattern.largest);
        patch.length = std::max(tree_.support_spheres()[node].radius, error.extent);
        const int bias = levels_.contrast_level(static_cast<double>(error.bias), 1);
        if (bias != no_contrast && PatternLevels::contrast(bias) * whole_peak_ > 1) {
            pattern.luminance = std::max(pattern.luminance, whole_);
            pattern.bias = bias, pattern.fading = error.fading;
            pattern.quarters = static_cast<int>(
                std::ceil(4 * std::log2(std::max(std::min(widest, object_radius_ / patch.length), 1.0f))));
        }
        pattern = switch_distances_.simplified(pattern);
        patch.row = switch_distances_.row(pattern);
        if (!(error.thickness > 0)) return patch;
        // One half of a narrow ring becomes brighter, the other darker.
        ShownFold thin{.pattern = {.luminance = levels_.luminance_level(middle)}, .length = error.thickness / 4};
        thin.pattern.largest = thin.pattern.typical =
            levels_.contrast_level(change(node, error.thin_luminance, moved, 0), middle);
        thin.pattern = switch_distances_.simplified(thin.pattern);
        thin.row = switch_distances_.row(thin.pattern);
        cover(switch_distances_, thin, patch);
        return thin;
    }

    ShownFold strip(const LitErrors& lit, NodeId node) const {
        const vdtree::LuminanceRange range = lit.tree->ring_luminance()[node];
        const double lo = levels_.in_cdm2(range.lo), hi = levels_.in_cdm2(range.hi);
        ShownFold strip;
        for (const auto& [bright, dark] : {std::pair(brightest_, lo), std::pair(hi, darkest_)}) {
            const double mean = (bright + dark) / 2;
            const Pattern own{.luminance = levels_.luminance_level(mean),
                              .largest = levels_.contrast_level(std::hypot(bright - dark, colour_), mean),
                              .is_strip = true};
            strip.pattern = above(strip.pattern, own);
        }
        const FoldError& error = lit.errors[node];
        const auto with = [&](Course course, float length) {
            ShownFold shifted{strip.pattern, length, 0};
            shifted.pattern.course = course;
            shifted.row = switch_distances_.row(shifted.pattern);
            return shifted;
        };
        if (error.outline >= whole_part * object_radius_) return with(Course::one_way, error.outline);
        strip = with(Course::to_and_fro, error.distance);
        if (error.border > 0) cover(switch_distances_, strip, with(Course::as_made, error.border));
        return strip;
    }

private:
    // cd/m2: the largest difference of light between places of the ring, or at the edge of a shadow.
    double moved_light(const LitErrors& lit, NodeId node) const {
        const vdtree::LuminanceRange range = lit.tree->ring_luminance()[node];
        const double of_luminance = tree_.texture().empty()
                                        ? levels_.in_cdm2(range.hi) - levels_.in_cdm2(range.lo)
                                        : levels_.difference_in_cdm2(spread_of_vertices(*lit.tree, node));
        const double of_vertices = lit.colour_range.empty()
                                       ? of_luminance
                                       : std::hypot(of_luminance, levels_.difference_in_cdm2(lit.colour_range[node]));
        return std::max(of_vertices, levels_.difference_in_cdm2(lit.edge_of_shadow(node)));
    }
    // cd/m2: by how much the fold changes light where it changes luminance by this much and shifts by this distance.
    double change(NodeId node, float luminance, double moved, double distance) const {
        if (tree_.bounds()[node].flags & vdtree::translucent_ring)
            return brightest_ - darkest_; // anything may show through
        const double radius = tree_.bounds()[node].ring.radius;
        return levels_.difference_in_cdm2(luminance) + moved * (radius > 0 ? std::min(1.0, distance / radius) : 1.0);
    }

    const vdtree::SoundTree& tree_; // all that does not depend on the light
    PatternLevels levels_;
    SwitchDistances& switch_distances_;
    double darkest_, brightest_; // cd/m2
    double colour_;              // cd/m2: how far apart colours in the scene are
    float object_radius_;
    int whole_;         // luminance level of the whole mesh
    double whole_peak_; // the sensitivity to it
};

// What each fold shows, no less than its children's: a patch, and a strip where it is an outline. If one tree is given
// under several lights, the light that shows more counts. `highest_cpd`: what the display can show. Empty if there are
// more patterns than rows: then coarsen the rows and ask again.
std::optional<ShownFolds> find_shown(std::span<const LitErrors> as_lit, const FoldTestOptions& options,
                                     const CsfTable& csf, double highest_cpd, SwitchDistances& switch_distances) {
    const vdtree::SoundTree& tree = *as_lit.front().tree;
    const PatternFinder patterns(tree, as_lit.front().colour_reach, options, csf, highest_cpd, switch_distances);
    ShownFolds shown{std::vector<ShownFold>(tree.interior_count()), std::vector<ShownFold>(tree.interior_count())};
    for (NodeId node = tree.interior_count(); node-- > 0;) { // children before parents
        ShownFold patch = patterns.patch(as_lit.front(), node), strip = patterns.strip(as_lit.front(), node);
        for (const LitErrors& lit : as_lit.subspan(1)) {
            cover(switch_distances, patch, patterns.patch(lit, node));
            cover(switch_distances, strip, patterns.strip(lit, node));
        }
        cover(switch_distances, patch, shown.patches[node]); // the children's
        shown.patches[node] = patch;
        cover(switch_distances, strip, shown.strips[node]);
        shown.strips[node] = strip;
        if (node > 0) {
            const NodeId parent = tree.parents()[node];
            cover(switch_distances, shown.patches[parent], patch);
            cover(switch_distances, shown.strips[parent], strip);
        }
        if (switch_distances.has_too_few()) return std::nullopt;
    }
    return shown;
}

// Nodes of one stage keep the order of what they show themselves: by up to this share they count as seen from farther.
constexpr float order_in_stage = 1.0f / 1024;
constexpr float most_octaves = 64; // from the nearest to the farthest that is told apart

// By interior node: from how far its own pattern is seen where one looks, in octaves of the mesh's radius; no less than
// its children's.
std::vector<float> octaves_of_distances(const vdtree::SoundTree& tree, const SwitchDistances& switch_distances,
                                        const ShownFolds& shown) {
    const float radius = tree.support_spheres()[vdtree::VertexTree::root()].radius;
    std::vector<float> octaves(shown.patches.size(), -most_octaves / 2);
    for (NodeId node = static_cast<NodeId>(octaves.size()); node-- > 0;) {
        for (const ShownFold& fold : {shown.patches[node], shown.strips[node]}) {
            const float distance = switch_distances.switch_distance(fold.row)[0] * fold.length;
            if (distance > 0)
                octaves[node] = std::max(octaves[node], std::min(std::log2(distance / radius), most_octaves / 2));
        }
        if (node == 0) continue;
        float& above = octaves[tree.parents()[node]];
        above = std::max(above, octaves[node]);
    }
    return octaves;
}

// Gives a node its stage's pattern, one of `stages`, where that is seen from no farther than the node's own from
// anywhere, unless a child would then be seen from farther. `octaves`: by node, what orders the nodes of a stage.
void fold_in_stages(const vdtree::SoundTree& tree, std::span<const FoldError> errors,
                    const SwitchDistances& switch_distances, std::span<const ShownFold> stages,
                    std::span<const float> octaves, std::span<ShownFold> shown) {
    const auto stage_of = [&](NodeId node) {
        ShownFold stage = stages[errors[node].stage];
        stage.length *= 1 + order_in_stage * (octaves[node] / most_octaves + 0.5f);
        return stage;
    };
    std::vector<bool> may_take(shown.size(), true);
    for (NodeId node = static_cast<NodeId>(shown.size()); node-- > 0;) {
        const ShownFold stage = stage_of(node);
        if (may_take[node] && shortfall(switch_distances, shown[node], stage) <= 1) {
            shown[node] = stage; // no more than the parent's own, nor its stage
            continue;
        }
        if (node == 0) return;
        const NodeId parent = tree.parents()[node];
        if (!(shortfall(switch_distances, stage_of(parent), shown[node]) <= 1)) may_take[parent] = false;
    }
}

} // namespace

DistanceCriterion::Parts criterion_parts(std::span<const LitErrors> as_lit, std::span<const FoldStage> measured_stages,
                                         const vdtree::View& view, const FoldTestOptions& options) {
    const vdtree::SoundTree& tree = *as_lit.front().tree;
    const std::span<const FoldError> errors = as_lit.front().errors;
    const NodeId nodes = tree.interior_count();
    const Screen screen(view, options);
    const PatternLevels levels(options.display);
    const CsfTable& csf = csf_of(options);

    DistanceCriterion::Parts parts;
    parts.spheres = DistanceCriterion::Spheres::ring;
    parts.eccentricity_bins = options.gaze_px ? bin_count : 1;
    parts.bin_degrees = degrees_per_bin / screen.least_magnification;
    parts.facing.resize(nodes);
    parts.classes.resize(nodes);
    parts.lengths.resize(nodes);
    parts.silhouette_lengths.resize(nodes);
    const float object_radius = tree.support_spheres()[vdtree::VertexTree::root()].radius;
    const Surround surround = surround_of(tree, options);
    SwitchDistances switch_distances(levels, screen, csf, options.model, surround, parts.eccentricity_bins,
                                     measured_stages.size());
    std::optional<ShownFolds> shown;
    while (!(shown = find_shown(as_lit, options, csf, screen.highest_cpd, switch_distances)))
        switch_distances.coarsen();
    // The edge of a shadow on the mesh moves with the surface as its outline would before what is in the shadow.
    FoldTestOptions behind = options;
    const bool has_edges = std::ranges::any_of(as_lit, [](const LitErrors& lit) { return !lit.casting.empty(); });
    if (behind.scene.behind && has_edges)
        for (const LitErrors& lit : as_lit) {
            const vdtree::LuminanceRange own = lit.tree->luminance_range();
            behind.scene.behind->lo = std::min(behind.scene.behind->lo, own.lo);
            behind.scene.behind->hi = std::max(behind.scene.behind->hi, own.hi);
        }
    const std::vector<float> distances =
        stage_distances(tree, measured_stages, screen, behind, parts.eccentricity_bins);
    if (!distances.empty() && object_radius > 0) {
        std::vector<ShownFold> stages;
        for (std::size_t first = 0; first < distances.size(); first += parts.eccentricity_bins) {
            const std::uint16_t row =
                switch_distances.add(std::span(distances).subspan(first, parts.eccentricity_bins), object_radius);
            stages.push_back({.pattern = {}, .length = object_radius, .row = row});
        }
        const std::vector<float> octaves = octaves_of_distances(tree, switch_distances, *shown);
        fold_in_stages(tree, errors, switch_distances, stages, octaves, shown->patches);
        fold_in_stages(tree, errors, switch_distances, stages, octaves, shown->strips);
    }
    for (NodeId node = 0; node < nodes; ++node) {
        parts.classes[node] = {shown->patches[node].row, shown->strips[node].row};
        parts.facing[node] = errors[node].facing;
        parts.lengths[node] = shown->patches[node].length;
        parts.silhouette_lengths[node] = shown->strips[node].length;
    }
    parts.switch_distance = switch_distances.take();
    return parts;
}

Result<DistanceCriterion> error_distances(const vdtree::VertexTree& tree, const vdtree::View& view,
                                          const FoldTestOptions& options) {
    const TreeAsLit own{tree.share(), {}};
    return error_distances(std::span(&own, 1), view, options);
}

Result<DistanceCriterion> error_distances(std::span<const TreeAsLit> as_lit, const vdtree::View& view,
                                          const FoldTestOptions& options) {
    if (const auto valid = check_arguments(view, options); !valid) return valid.error();
    if (const auto valid = validate(options.model); !valid) return valid.error();
    const auto trees = LitTrees::of(as_lit, options.model);
    if (!trees) return trees.error();
    return DistanceCriterion::create(trees->tree(), criterion_parts(trees->as_lit(), trees->stages(), view, options));
}

} // namespace unseen::perception
