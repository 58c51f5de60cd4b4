// The fold tests after Luebke and Hallen in distance form: a table of switch distances by class and eccentricity.

#include <unseen/perception/internal/cut_rings.h>
#include <unseen/vdtree/internal/light_bounds.h>
#include <unseen/vdtree/internal/parallel.h>

#include "fold/fold_classes.h"
#include "fold/fold_screen.h"

namespace unseen::perception {
namespace {

using vdtree::ContrastClasses;
using vdtree::DistanceCriterion;
using vdtree::NodeId;

// ---- extents and distances

// In degrees on the screen; infinite where the row shows nothing at any extent. Smaller is what comes first: bins in
// ascending eccentricity. `Visibility`: of a grating, by its frequency in cpd and its eccentricity in degrees; 1 is
// just visible. It must not grow with either.
template <class Visibility>
class LargestExtents {
public:
    // Extents around the spheres are larger than these, from whose nearest points eccentricity is counted: they reach
    // nearer to the gaze, by half of their width at most.
    LargestExtents(Visibility visibility, const Screen& screen, bool is_around_spheres)
        : visibility_(visibility), is_around_spheres_(is_around_spheres),
          step_(step_of(screen.pixel_deg / smallest_of_a_pixel)) {}

    double at(double eccentricity_deg) {
        // Extents are from a fixed series, so that more contrast never makes them larger.
        if (step_ == last_step || is_unseen(last_step, eccentricity_deg)) {
            step_ = last_step;
            return std::numeric_limits<double>::infinity();
        }
        int above = step_ + 1;
        for (int stride = 1; above < last_step && is_unseen(above, eccentricity_deg); stride *= 2) {
            step_ = above;
            above = std::min(above + stride, last_step);
        }
        while (above - step_ > 1) {
            const int middle = step_ + (above - step_) / 2;
            (is_unseen(middle, eccentricity_deg) ? step_ : above) = middle;
        }
        return extent(step_);
    }

private:
    static constexpr double steps_per_octave = 128;
    static constexpr int last_step = 9 * 128;           // 512 degrees: all that is seen
    static constexpr double smallest_of_a_pixel = 1024; // far below what any fold costs 1 at

    static double extent(int step) { return std::exp2(step / steps_per_octave); }
    static int step_of(double extent_deg) {
        return static_cast<int>(std::floor(steps_per_octave * std::log2(extent_deg)));
    }
    bool is_unseen(int step, double eccentricity_deg) const {
        const double nearest =
            is_around_spheres_ ? std::max(0.0, eccentricity_deg - extent(step) / 2) : eccentricity_deg;
        return visibility_(1 / (2 * extent(step)), nearest) <= 1;
    }

    Visibility visibility_;
    bool is_around_spheres_;
    int step_; // not seen, or smaller than anything that matters
};

// The extents, by bins so many degrees apart, of what has this contrast and luminance alone and is no larger than its
// sphere, all at once. Infinite where not even the peak is seen.
void find_grey_extents(double contrast, double luminance_cdm2, const CsfTable& csf, double bin_degrees,
                       std::span<double> extents) {
    std::array<float, 2 * bin_count> contrasts, eccentricity, luminance, log2_frequency;
    const auto used = [&](auto& all) { return std::span(all).first(extents.size()); };
    for (std::size_t bin = 0; bin < extents.size(); ++bin)
        eccentricity[bin] = static_cast<float>(static_cast<double>(bin) * bin_degrees);
    contrasts.fill(static_cast<float>(contrast));
    luminance.fill(static_cast<float>(luminance_cdm2));
    csf.highest_visible_log2_frequency(used(contrasts), used(eccentricity), used(luminance), used(log2_frequency));
    for (std::size_t bin = 0; bin < extents.size(); ++bin)
        extents[bin] = 1 / (2 * std::exp2(static_cast<double>(log2_frequency[bin])));
}

// The distance, in lengths, from which an extent is no larger than this on the screen.
float switch_distance_of(double extent_deg, const Screen& screen, bool is_around_spheres) {
    if (std::isinf(extent_deg)) return 0; // only from inside
    const double half = extent_deg / screen.largest_magnification / degrees_per_radian / 2;
    const double in_lengths = half < std::numbers::pi / 2 ? 1 / std::sin(half) : 1; // from the centre
    return static_cast<float>((is_around_spheres ? in_lengths : in_lengths - 1) * (1 + distance_rounding));
}

constexpr float length_rounding = 1e-6f; // covers that of a mean of two floats

// Fills a row of a table by its extents. `visibility`: by bin, of what shows from whatever distance.
template <class Visibility>
void set_row(vdtree::DistanceCriterion::Parts& parts, std::size_t row, std::span<const double> extents,
             const Screen& screen, const Visibility& visibility) {
    const std::size_t bins = parts.eccentricity_bins;
    float *const switch_distance = &parts.switch_distance[row * bins], *const least_cost =
                                                                           &parts.least_cost[row * bins];
    for (std::size_t bin = 0; bin < bins; ++bin) {
        switch_distance[bin] = switch_distance_of(extents[bin], screen, !parts.lengths.empty());
        // No fold is drawn smaller than a pixel.
        least_cost[bin] = static_cast<float>(std::max(screen.pixel_deg / extents[bin], visibility(bin)));
        // The table's own rounding must not make anything grow with the eccentricity.
        if (bin == 0) continue;
        switch_distance[bin] = std::min(switch_distance[bin], switch_distance[bin - 1]);
        least_cost[bin] = std::min(least_cost[bin], least_cost[bin - 1]);
    }
}

// Half the extents of folds, mesh units: the change is largest within the support and fades to nothing at the ring's
// border. No less than the children's.
std::vector<float> safe_lengths(const vdtree::SoundTree& tree, const CutRings& rings) {
    std::vector<float> lengths(tree.interior_count(), 0.0f);
    for (vdtree::NodeId node = tree.interior_count(); node-- > 0;) {
        const float around = 0.5f * (tree.support_spheres()[node].radius + rings.radius[node]) * (1 + length_rounding);
        lengths[node] = std::max({lengths[node], tree.bounds()[node].ring.radius, around});
        if (node > 0) lengths[tree.parents()[node]] = std::max(lengths[tree.parents()[node]], lengths[node]);
    }
    return lengths;
}

// The directions that make nodes outlines; empty: the tree's. Where another part is near, any.
std::vector<vdtree::NormalSlabs> safe_facing(const vdtree::VertexTree& tree, const CutRings& rings) {
    std::vector<vdtree::NormalSlabs> facing;
    if (!rings.meets_another.empty())
        for (vdtree::NodeId node = 0; node < tree.interior_count(); ++node)
            facing.push_back(rings.meets_another[node] ? vdtree::NormalSlabs::everything() : tree.bounds()[node].slabs);
    return facing;
}

// ---- under the tree's own light

// Bins of eccentricity on the screen; beyond the last one sensitivity is taken as there.
struct Bins {
    double degrees;
    std::size_t count;

    double at(std::size_t bin) const { return static_cast<double>(bin) * degrees; } // the nearest to the gaze
};
constexpr Bins coarse_bins{degrees_per_bin, bin_count}, fine_bins{degrees_per_bin / 2, 2 * bin_count};

// The sensitivities that a test uses: to colour only where it looks at colour.
struct Sensitivities {
    CsfTable luminance;
    Surround surround;
    std::optional<CsfTable> red_green, yellow_violet;

    // To gratings without end, of whatever frequency is seen best; as wide as the mesh, over its mean with what is
    // behind.
    double of_areas(Degrees eccentricity, Luminance at) const {
        const Luminance mean(surround.mean_cdm2(at.value(), 1));
        return std::max(of_areas_at(eccentricity, at), at / mean * of_areas_at(eccentricity, mean));
    }
    static constexpr SquareDegrees unlimited{std::numeric_limits<double>::infinity()};

private:
    double of_areas_at(Degrees eccentricity, Luminance at) const {
        constexpr double octaves = 0.25;
        constexpr int steps = 40; // to 64 cpd
        static const std::array<double, steps> gains = [] {
            std::array<double, steps> all{}; // by step: no less than within it, for gains grow with the frequency
            for (int i = 0; i < steps; ++i)
                all[static_cast<std::size_t>(i)] =
                    summation_gain(CyclesPerDegree(lowest_table_cpd * std::exp2((i + 1) * octaves)), unlimited);
            return all;
        }();
        const double own = luminance.samples().summation;
        double best = 0;
        for (int i = 0; i < steps; ++i) {
            const CyclesPerDegree low(lowest_table_cpd * std::exp2(i * octaves));
            best = std::max(best, own * gains[static_cast<std::size_t>(i)] *
                                      luminance.monotone_sensitivity(low, eccentricity, at));
        }
        return best;
    }
};

// Whether patches are taken for gratings alone, as published, or for what else half a wave holds.
enum class Patches { gratings, half_waves };

Sensitivities sensitivities_for(const FoldTestOptions& options, const Surround& surround, bool has_chroma,
                                Patches patches) {
    const auto seen = [&](const CsfTable& table) {
        return patches == Patches::half_waves ? table.of_half_waves() : table;
    };
    Sensitivities all{seen(csf_of(options)), surround, {}, {}};
    if (!has_chroma) return all;
    static const CsfTable red_green = CsfTable::from_model(CsfModel::castle_red_green);
    static const CsfTable yellow_violet = CsfTable::from_model(CsfModel::castle_yellow_violet);
    // Whoever sees luminance so many times as well as the median person sees colours so.
    const Luminance usual(20);
    const double gain =
        csf_of(options).peak_sensitivity(Degrees(0), usual) / CsfTable::standard().peak_sensitivity(Degrees(0), usual);
    const auto for_observer = [&](const CsfTable& table) {
        const auto scaled = table.scaled(gain);
        return seen(scaled ? *scaled : table);
    };
    all.red_green = for_observer(red_green);
    all.yellow_violet = for_observer(yellow_violet);
    return all;
}

// A row of the table: how visible its contrasts are.
struct Row {
    double contrast, shift, luminance_cdm2;
    glm::dvec2 chroma, chroma_shift;
    double texture, texture_motion;

    Row(const Level& level, const Classes& classes)
        : contrast(classes.contrasts().value(level.contrast)), shift(shifts.value(level.shift)),
          luminance_cdm2(classes.luminance(level.luminance)),
          chroma(chroma_contrasts.value(level.chroma[0]), chroma_contrasts.value(level.chroma[1])),
          chroma_shift(chroma_shifts.value(level.chroma_shift[0]), chroma_shifts.value(level.chroma_shift[1])),
          texture(texture_contrasts.value(level.texture)),
          texture_motion(std::min(texture_motions.value(level.texture_motion), 1.0)) {}

    bool has_chroma() const { return chroma != glm::dvec2(0); }
    bool has_texture() const { return texture > 0; }

    // 1 is just visible: of a grating of this frequency in all directions of colour.
    double visibility(const Sensitivities& see, double frequency_cpd, double eccentricity_deg) const {
        const CyclesPerDegree frequency(frequency_cpd);
        const Degrees eccentricity(eccentricity_deg);
        const Luminance luminance(luminance_cdm2);
        const double sensitivity =
            contrast > 0 || has_texture() ? see.luminance.monotone_sensitivity(frequency, eccentricity, luminance) : 0;
        double grey = contrast * sensitivity;
        if (has_texture())
            grey =
                std::min(grey + texture * moved_sensitivity(see, frequency_cpd, eccentricity, luminance), sensitivity);
        if (!has_chroma()) return grey;
        return std::hypot(grey, chroma.x * see.red_green->monotone_sensitivity(frequency, eccentricity, luminance),
                          chroma.y * see.yellow_violet->monotone_sensitivity(frequency, eccentricity, luminance));
    }
    // To a pattern that moves by a share of half a wave of this frequency, within a patch that holds no lower ones: the
    // bands of higher frequencies see the share of it that lies in their own half waves.
    double moved_sensitivity(const Sensitivities& see, double lowest_cpd, Degrees eccentricity,
                             Luminance luminance) const {
        constexpr double steps_per_octave = 2;
        double largest = 0;
        for (double multiple = 1;
             ;) { // sensitivity falls and shares grow: up to the next step both are no more than this
            const double next = multiple * std::exp2(1 / steps_per_octave);
            const double share = std::min(1.0, next * texture_motion);
            largest = std::max(largest, share * see.luminance.monotone_sensitivity(
                                                    CyclesPerDegree(lowest_cpd * multiple), eccentricity, luminance));
            if (share >= 1) return largest;
            multiple = next;
        }
    }
    // The visibility of shifts of the mean, at the frequency where they are seen best, over areas of any size.
    double shift_visibility(const Sensitivities& see, double eccentricity_deg) const {
        const Degrees eccentricity(eccentricity_deg);
        const Luminance luminance(luminance_cdm2);
        const double grey = shift > 0 ? shift * see.of_areas(eccentricity, luminance) : 0;
        if (chroma_shift == glm::dvec2(0)) return grey;
        return std::hypot(grey, chroma_shift.x * see.red_green->peak_sensitivity(eccentricity, luminance),
                          chroma_shift.y * see.yellow_violet->peak_sensitivity(eccentricity, luminance));
    }
};

void fill_table(DistanceCriterion::Parts& parts, const Rows& rows, const Classes& classes, const Bins& eccentricities,
                const Screen& screen, const Sensitivities& see) {
    const std::size_t bins = parts.eccentricity_bins;
    const bool is_around_spheres = !parts.lengths.empty();
    parts.switch_distance.assign((rows.levels().size() + 1) * bins, DistanceCriterion::never_visible);
    parts.least_cost.assign(parts.switch_distance.size(), 0);
    // Extents do not depend on shifts of the mean, which is all that many rows differ by.
    std::unordered_map<std::uint64_t, std::size_t> known;
    std::vector<std::size_t> extents_of, first_rows; // by row; by extents
    for (std::size_t i = 0; i < rows.levels().size(); ++i) {
        Level without_shifts = rows.levels()[i];
        without_shifts.shift = 0;
        without_shifts.chroma_shift = {};
        const auto [found, is_new] = known.try_emplace(without_shifts.number(), first_rows.size());
        if (is_new) first_rows.push_back(i);
        extents_of.push_back(found->second);
    }
    std::vector<std::vector<double>> extents(first_rows.size(), std::vector<double>(bins));
    parallel_loop(std::size_t{0}, extents.size(), [&](std::size_t i) {
        const Row row(rows.levels()[first_rows[i]], classes);
        if (is_around_spheres || row.has_chroma() || row.has_texture()) {
            LargestExtents largest(
                [&](double frequency, double eccentricity) { return row.visibility(see, frequency, eccentricity); },
                screen, is_around_spheres);
            for (std::size_t bin = 0; bin < bins; ++bin) extents[i][bin] = largest.at(eccentricities.at(bin));
        } else {
            find_grey_extents(row.contrast, row.luminance_cdm2, see.luminance, eccentricities.degrees, extents[i]);
        }
    });
    parallel_loop(std::size_t{0}, extents_of.size(), [&](std::size_t i) {
        const Row row(rows.levels()[i], classes);
        set_row(parts, i + 1, extents[extents_of[i]], screen,
                [&](std::size_t bin) { return row.shift_visibility(see, eccentricities.at(bin)); });
    });
}

// Silhouettes may uncover anything in the scene.
vdtree::LuminanceRange outline_of(vdtree::LuminanceRange range, const SceneLuminance& scene) {
    return {std::min(range.lo, scene.darkest), std::max(range.hi, scene.brightest)};
}

double middle_of(vdtree::LuminanceRange range) {
    return 0.5 * (static_cast<double>(range.lo) + static_cast<double>(range.hi));
}

glm::dvec2 half_of(const ChromaRange& range) { return (glm::dvec2(range.hi) - glm::dvec2(range.lo)) * 0.5; }

// The object's colours, and the background, which is grey.
ChromaRange scene_chroma(std::span<const ChromaRange> rings) {
    const ChromaRange& all = rings[vdtree::VertexTree::root()];
    return {glm::min(all.lo, glm::vec2(0)), glm::max(all.hi, glm::vec2(0))};
}

// What a test takes of the tree.
struct Rings {
    std::span<const vdtree::PackedRange> luminance;
    std::span<const ChromaRange> chroma;    // none: not looked at
    std::span<const float> mean_shift = {}; // likewise
    std::span<const glm::vec2> mean_chroma_shift = {};
    std::span<const vdtree::PackedRange> vertices = {},
                                         texture = {}; // where the texture is counted by how far it moves; then, too:
    std::span<const float> texture_deviation = {}, lengths = {}; // mesh units
    std::vector<vdtree::NormalSlabs> facing = {};                // empty: the tree's
};

// All that grows up the tree stays so: contrasts against a middle would not.
void saturate(RingLooks& parent, const RingLooks& child) {
    parent.adaptation = std::max(parent.adaptation, child.adaptation);
    parent.least_contrast = std::max(parent.least_contrast, child.least_contrast);
    parent.shift = std::max(parent.shift, child.shift);
    parent.chroma = glm::max(parent.chroma, child.chroma);
    parent.chroma_shift = glm::max(parent.chroma_shift, child.chroma_shift);
}

// For a surface that faces the eye: its vertices' contrast where the texture is brightest, the texture's where the
// vertices are, and how far that moves: no less than in the children, whose shares of their extents are rounded up.
void add_texture(RingLooks& inside, const Rings& rings, NodeId node, const Classes& classes,
                 std::vector<double>& motions) {
    const vdtree::LuminanceRange vertices = rings.vertices[node], texture = rings.texture[node];
    inside.range = {vertices.lo * texture.hi, vertices.hi * texture.hi};
    inside.texture = classes.contrast({vertices.hi * texture.lo, vertices.hi * texture.hi});
    const double length = static_cast<double>(rings.lengths[node]);
    double& motion = motions[node];
    motion = std::max(motion, static_cast<double>(rings.texture_deviation[node]));
    // Half waves fill twice the length.
    inside.texture_motion = motion > 0 ? (length > 0 ? std::min(1.0, motion / (2 * length)) : 1.0) : 0.0;
    motion = std::min(1.0, texture_motions.value(texture_motions.of(inside.texture_motion))) * 2 * length;
}

// Puts all nodes into classes. False where there are too many of them for rows so fine.
bool classify(const vdtree::SoundTree& tree, const Rings& rings, const FoldTestOptions& options, const Classes& classes,
              Rows& rows, std::vector<vdtree::FoldClass>& fold_classes) {
    const bool has_chroma = !rings.chroma.empty();
    const glm::dvec2 of_scene = has_chroma ? half_of(scene_chroma(rings.chroma)) : glm::dvec2(0);
    std::vector<RingLooks> interior(tree.interior_count()), outlines(tree.interior_count());
    std::vector<double> motions(rings.vertices.size(), 0); // of textures
    fold_classes.resize(tree.interior_count());
    for (NodeId node = tree.interior_count(); node-- > 0;) { // children before parents
        RingLooks &inside = interior[node], &outline = outlines[node];
        outline.range = outline_of(rings.luminance[node], options.scene);
        // Anything in the scene may show through.
        const bool is_translucent = tree.bounds()[node].flags & vdtree::translucent_ring;
        inside.range = is_translucent ? outline.range : vdtree::LuminanceRange(rings.luminance[node]);
        inside.adaptation = std::max(
            {inside.adaptation, static_cast<double>(tree.adaptation_luminance()[node]), middle_of(inside.range)});
        if (!rings.vertices.empty() && !is_translucent) add_texture(inside, rings, node, classes, motions);
        outline.least_contrast = std::max(outline.least_contrast, classes.sum_of_contrasts(inside));
        if (!rings.mean_shift.empty())
            inside.shift = std::max(
                inside.shift, classes.contrast(static_cast<double>(rings.mean_shift[node]), rings.luminance[node]));
        if (has_chroma) {
            inside.chroma =
                glm::max(inside.chroma, classes.chroma_contrast(is_translucent ? of_scene : half_of(rings.chroma[node]),
                                                                inside.range));
            outline.chroma =
                glm::max(glm::max(outline.chroma, inside.chroma), classes.chroma_contrast(of_scene, outline.range));
            if (!rings.mean_chroma_shift.empty())
                inside.chroma_shift = glm::max(
                    inside.chroma_shift, classes.chroma_contrast(rings.mean_chroma_shift[node], rings.luminance[node]));
        }
        saturate(outline, {outline.range, std::max(inside.adaptation, middle_of(outline.range)), inside.shift,
                           glm::dvec2(0), inside.chroma_shift});
        fold_classes[node] = {rows.of(classes.level(inside)), rows.of(classes.level(outline))};
        if (rows.is_full()) return false;
        if (node == 0) break;
        saturate(interior[tree.parents()[node]], inside);
        if (!motions.empty()) motions[tree.parents()[node]] = std::max(motions[tree.parents()[node]], motions[node]);
        saturate(outlines[tree.parents()[node]], outline);
    }
    return true;
}

Result<DistanceCriterion> make_criterion(const vdtree::SoundTree& tree, const Rings& rings, std::vector<float> lengths,
                                         Patches patches, const vdtree::View& view, const FoldTestOptions& options) {
    if (const auto valid = check_arguments(view, options); !valid) return valid.error();
    const Screen screen(view, options);
    const bool has_chroma = !rings.chroma.empty();
    // Where contrasts and luminances alone make the rows, these are few enough, and quickly found, to be fine.
    const bool is_fine = !has_chroma && rings.mean_shift.empty() && rings.vertices.empty() && lengths.empty();
    // Only shifts of the mean need it.
    const Surround surround = rings.mean_shift.empty() ? Surround() : surround_of(tree, options);
    const Classes classes(options.display, is_fine ? fine_contrasts : coarse_contrasts);
    const Bins& bins = is_fine ? fine_bins : coarse_bins;
    DistanceCriterion::Parts parts;
    parts.spheres = DistanceCriterion::Spheres::ring;
    parts.eccentricity_bins = options.gaze_px ? bins.count : 1;
    parts.bin_degrees = bins.degrees / screen.least_magnification;
    parts.lengths = std::move(lengths);
    parts.facing = rings.facing;
    for (std::size_t coarseness = 1;; coarseness *= 2) {
        Rows rows(!has_chroma && rings.vertices.empty(), classes.contrasts(), coarseness);
        if (!classify(tree, rings, options, classes, rows, parts.classes)) continue;
        fill_table(parts, rows, classes, bins, screen, sensitivities_for(options, surround, has_chroma, patches));
        return DistanceCriterion::create(tree, std::move(parts));
    }
}

} // namespace

Result<DistanceCriterion> luebke_hallen_distances(const vdtree::VertexTree& tree, const vdtree::View& view,
                                                  const FoldTestOptions& options) {
    const auto sound = vdtree::SoundTree::of(tree);
    if (!sound) return sound.error();
    Rings rings{tree.ring_luminance(), {}};
    std::vector<ChromaRange> chroma;
    if (tree.texture().empty()) {
        auto found = ring_chroma(tree);
        if (!found) return found.error();
        chroma = std::move(*found);
    }
    rings.chroma = chroma;
    return make_criterion(*sound, rings, {}, Patches::gratings, view, options);
}

Result<DistanceCriterion> luebke_hallen_safe_distances(const vdtree::VertexTree& tree, const CutRings& cut_rings,
                                                       const vdtree::View& view, const FoldTestOptions& options) {
    const auto sound = vdtree::SoundTree::of(tree);
    if (!sound) return sound.error();
    Rings rings{cut_rings.luminance, {}, cut_rings.mean_shift};
    if (cut_rings.chroma.empty() && tree.texture().empty() && has_chroma(tree))
        return invalid_argument("The rings were bounded without their colours, which count.");
    rings.chroma = cut_rings.chroma;
    rings.mean_chroma_shift = cut_rings.mean_chroma_shift;
    std::vector<float> lengths = safe_lengths(*sound, cut_rings);
    rings.facing = safe_facing(tree, cut_rings);
    rings.vertices = cut_rings.vertices;
    rings.texture = cut_rings.texture;
    rings.texture_deviation = cut_rings.texture_deviation;
    const std::vector<float> own_lengths =
        rings.vertices.empty() ? std::vector<float>() : lengths; // which the criterion takes
    rings.lengths = own_lengths;
    return make_criterion(*sound, rings, std::move(lengths), Patches::half_waves, view, options);
}

vdtree::Viewpoint viewpoint_of(const vdtree::VertexTree& tree, const vdtree::View& view, const FoldTestOptions& options,
                               const vdtree::Similarity& placement, bool window_only) {
    vdtree::Viewpoint viewpoint = vdtree::viewpoint_of(tree, view, placement, window_only);
    if (options.gaze_px) {
        const Screen screen(view, options);
        const vdtree::CameraFrame frame = vdtree::camera_frame(view);
        const glm::dvec2 from_axis = *options.gaze_px - vdtree::axis_px(view);
        const double x = from_axis.x * screen.pitch_over_distance / screen.scale;
        const double y = -from_axis.y * screen.pitch_over_distance / screen.scale;
        viewpoint.gaze = glm::normalize(placement.direction_to_mesh(x * frame.right + y * frame.up - frame.back));
    }
    return viewpoint;
}

// ---- under lights that may move

namespace {

void fill_table(DistanceCriterion::Parts& parts, const ContrastClasses& classes, const Screen& screen,
                const CsfTable& csf) {
    const std::size_t bins = parts.eccentricity_bins;
    parts.switch_distance.assign(ContrastClasses::class_count * bins, DistanceCriterion::never_visible);
    parts.least_cost.assign(ContrastClasses::class_count * bins, 0);
    std::vector<double> extents(bins);
    for (std::size_t number = 1; number < ContrastClasses::class_count; ++number) {
        const double contrast = ContrastClasses::contrast(number), luminance_cdm2 = classes.level(number);
        if (parts.lengths.empty()) {
            find_grey_extents(contrast, luminance_cdm2, csf, degrees_per_bin, extents);
        } else {
            const auto visibility = [&](double frequency, double eccentricity) {
                return contrast * csf.monotone_sensitivity(CyclesPerDegree(frequency), Degrees(eccentricity),
                                                           Luminance(luminance_cdm2));
            };
            LargestExtents largest(visibility, screen, true);
            for (std::size_t bin = 0; bin < bins; ++bin)
                extents[bin] = largest.at(static_cast<double>(bin) * degrees_per_bin);
        }
        set_row(parts, number, extents, screen, [](std::size_t) { return 0.0; });
    }
}

// Nothing falls with the contrast or the luminance; the table's own rounding must not make it.
void make_growing(DistanceCriterion::Parts& parts) {
    const std::size_t bins = parts.eccentricity_bins;
    const auto raise = [&](std::size_t number, std::size_t to) {
        for (std::vector<float>* values : {&parts.switch_distance, &parts.least_cost})
            for (std::size_t bin = 0; bin < bins; ++bin) {
                float& value = (*values)[number * bins + bin];
                value = std::max(value, (*values)[to * bins + bin]);
            }
    };
    for (std::size_t l = 0; l < ContrastClasses::level_count; ++l)
        for (std::size_t c = 0; c < ContrastClasses::contrast_count; ++c) {
            if (c > 0) raise(ContrastClasses::class_at(l, c), ContrastClasses::class_at(l, c - 1));
            if (l > 0) raise(ContrastClasses::class_at(l, c), ContrastClasses::class_at(l - 1, c));
        }
}

Result<DistanceCriterion> make_criterion(const vdtree::VertexTree& tree, DistanceCriterion::Parts parts,
                                         std::shared_ptr<const vdtree::LightBounds> bounds, const CsfTable& csf,
                                         const vdtree::View& view, const FoldTestOptions& options) {
    const Screen screen(view, options);
    const vdtree::AbsoluteScale scale = LuminanceClasses(options.display).scale();
    const ContrastClasses classes(scale);
    const SceneLuminance scene = options.scene;
    parts.spheres = DistanceCriterion::Spheres::ring;
    parts.eccentricity_bins = options.gaze_px ? bin_count : 1;
    parts.bin_degrees = degrees_per_bin / screen.least_magnification;
    parts.lit = std::make_shared<const vdtree::LitClasses>(
        vdtree::LitClasses{std::move(bounds), scale,
                           classes.class_of({scene.darkest, scene.brightest}, static_cast<double>(scene.brightest))});
    fill_table(parts, classes, screen, csf);
    make_growing(parts);
    return DistanceCriterion::create(tree, std::move(parts));
}

} // namespace

Result<DistanceCriterion> lit_distances(const vdtree::VertexTree& tree,
                                        std::shared_ptr<const vdtree::LightBounds> bounds, const vdtree::View& view,
                                        const FoldTestOptions& options) {
    if (const auto valid = check_arguments(view, options); !valid) return valid.error();
    return make_criterion(tree, {}, std::move(bounds), csf_of(options), view, options);
}

Result<DistanceCriterion> lit_safe_distances(const vdtree::VertexTree& tree, const CutRings& rings,
                                             std::shared_ptr<const vdtree::LightBounds> bounds,
                                             const vdtree::View& view, const FoldTestOptions& options) {
    if (const auto valid = check_arguments(view, options); !valid) return valid.error();
    const auto sound = vdtree::SoundTree::of(tree);
    if (!sound) return sound.error();
    if (rings.radius.size() != tree.interior_count() || !bounds || bounds->radii().size() != tree.interior_count())
        return invalid_argument(
            "The rings, or what lights make of them (bound_lit_cut_rings()), are not those of the tree.");
    DistanceCriterion::Parts parts;
    parts.lengths = safe_lengths(*sound, rings);
    parts.facing = safe_facing(tree, rings);
    return make_criterion(tree, std::move(parts), std::move(bounds), csf_of(options).of_half_waves(), view, options);
}

SceneLuminance lit_scene(const vdtree::VertexTree& tree, const vdtree::LightBounds& bounds,
                         const vdtree::Lighting& lighting, glm::dvec3 eye, float background) {
    const vdtree::NodeId root = vdtree::VertexTree::root();
    const vdtree::LuminanceRange range =
        vdtree::lit_range(lighting, bounds.cones()[root], bounds.sphere(tree, root), eye);
    constexpr float steps = 32;
    const float brightest = tree.texture().emission.empty() ? range.hi : 1.0f; // what shines may be white
    return {std::floor(steps * std::min(range.lo, background)) / steps,
            std::ceil(steps * std::max(brightest, background)) / steps};
}

} // namespace unseen::perception
