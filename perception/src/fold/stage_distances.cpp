// A stage is seen at the distance at which the contrasts of its pictures, in thresholds, masked by the mesh's own and
// pooled over the bands, come to 1. The nearer the eye, the lower the frequencies of all bands: one table of
// sensitivities serves all stages.
#include "fold/error_distances.h"

#include "fold/fold_factors.h"
#include "judge/modern_masking.h"

namespace unseen::perception {
namespace {

// The angles, in degrees, that the mesh's sphere is seen under, from far to near.
constexpr double least_angle = 0.01, angle_step = 1.0905077326652577; // an eighth of an octave
constexpr std::size_t angle_count = 96;                               // up to 38 degrees
double angle(std::size_t i) { return least_angle * std::pow(angle_step, static_cast<double>(i)); }

// Finer than the pictures' cells: at most what grows as fast as a line gets narrower, and unmasked.
constexpr std::size_t finer_bands = 3;

// By how much a contrast in thresholds counts, with unit contrast in each row of masks.
using Band = std::array<double, FoldStage::masks.size()>;
using Bands = std::array<Band, finer_bands + FoldStage::band_count>;

class Eye {
public:
    // Sees the brightest of the mesh, and what is behind it.
    Eye(const CsfTable& csf, double eccentricity_deg, Luminance mesh, Luminance behind, double highest_cpd) {
        for (std::size_t i = 0; i < angle_count; ++i) {
            for (std::size_t b = 0; b < bands_[i].size(); ++b) {
                const double octaves_finer = b < finer_bands ? static_cast<double>(finer_bands - b) : 0;
                const double cycles =
                    FoldStage::frequency(b < finer_bands ? 0 : b - finer_bands) * std::exp2(octaves_finer);
                const double luminance =
                    behind.value() + share_of_mesh(cycles) * std::max(mesh.value() - behind.value(), 0.0);
                const double cpd = cycles / angle(i);
                const double at = std::max(std::min(cpd, highest_cpd), lowest_table_cpd);
                // A pattern may cover all of the mesh.
                const double sensitivity =
                    share_on_display(cpd / highest_cpd) *
                    summation_gain(CyclesPerDegree(at), disc(angle(i)), csf.samples().summation) *
                    csf.monotone_sensitivity(CyclesPerDegree(at), Degrees(eccentricity_deg), Luminance(luminance));
                for (std::size_t row = 0; row < FoldStage::masks.size(); ++row) {
                    const double mask = b < finer_bands ? 0 : static_cast<double>(FoldStage::masks[row]);
                    bands_[i][b][row] = std::exp2(octaves_finer) * sensitivity / daly_elevation(mask * sensitivity);
                }
            }
        }
    }

    // The largest angle up to which the contrasts are invisible; 0 where they never are.
    double largest_angle(const FoldStage& stage, std::size_t first_background, std::size_t last_background,
                         double contrast_factor) const {
        for (std::size_t i = 0; i < angle_count; ++i)
            for (std::size_t k = first_background; k <= last_background; ++k)
                if (!(visibility(stage.contrast[k], bands_[i]) * contrast_factor <= 1)) return i > 0 ? angle(i - 1) : 0;
        return angle(angle_count - 1);
    }

private:
    // The share of a grating's contrast that the display shows, by multiples of its highest frequency: pixels show the
    // mean over their area. What is beyond the limit is taken for a grating of the limit.
    static double share_on_display(double times_highest) {
        if (!(times_highest < 2)) return 0;
        const double x = times_highest * std::numbers::pi / 2;
        return x > 0 ? std::sin(x) / x : 1;
    }

    // Of the mean luminance around a place that a band looks at, which adapts to it, a mesh that fills its whole sphere
    // makes up at most this: the pyramid's kernel is about a Gaussian of the deviation 1 / (sqrt(8) cycles) in
    // diameters of the sphere.
    static double share_of_mesh(double cycles) { return 1 - std::exp(-cycles * cycles); }

    // Bands add up as their energies do, the most of what is known of eyes: patterns of few nodes are in few bands, but
    // pictures of a whole mesh are in many, and models of the eye differ by how these add up.
    static double visibility(const float (&contrast)[FoldStage::band_count][FoldStage::masks.size()],
                             const Bands& bands) {
        double sum = 0;
        for (std::size_t b = 0; b < bands.size(); ++b) {
            const auto& rows = contrast[b < finer_bands ? 0 : b - finer_bands];
            double most = 0;
            for (std::size_t row = 0; row < FoldStage::masks.size(); ++row)
                most = std::max(most, static_cast<double>(rows[row]) * bands[b][row]);
            sum += most * most;
        }
        return std::sqrt(sum);
    }

    std::array<Bands, angle_count> bands_;
};

} // namespace

std::vector<float> stage_distances(const vdtree::VertexTree& tree, std::span<const FoldStage> stages,
                                   const Screen& screen, const FoldTestOptions& options, std::size_t bins) {
    const vdtree::LuminanceRange behind =
        options.scene.behind.value_or(vdtree::LuminanceRange{options.scene.darkest, options.scene.brightest});
    std::size_t first = 0,
                last = FoldStage::backgrounds.size() - 1; // the nearest ones that are not brighter, and not darker
    while (first < last && FoldStage::backgrounds[first + 1] <= behind.lo) ++first;
    while (last > first && FoldStage::backgrounds[last - 1] >= behind.hi) --last;
    const Luminance brightest = to_luminance(options.display, static_cast<double>(tree.luminance_range().hi));
    const Luminance brightest_behind = to_luminance(options.display, static_cast<double>(behind.hi));
    const double black = black_level(options.display).value(), span = to_luminance(options.display, 1).value() - black;
    // On darker displays contrasts are larger than those of the pictures.
    const double least = std::max(black / span, 1.0 / 4096);
    const double contrast_factor =
        std::max(1.0, static_cast<double>(FoldStage::black) / least) * factors::between_directions;
    const CsfTable& csf = csf_of(options);
    const double diameter = 2 * static_cast<double>(tree.bounding_sphere().radius);

    std::vector<float> distances(stages.size() * bins);
    for (std::size_t bin = 0; bin < bins && !stages.empty(); ++bin) {
        const Eye eye(csf, static_cast<double>(bin) * degrees_per_bin, brightest, brightest_behind, screen.highest_cpd);
        for (std::size_t stage = 0; stage < stages.size(); ++stage) {
            const double on_screen = eye.largest_angle(stages[stage], first, last, contrast_factor);
            const double seen = on_screen / screen.largest_magnification / degrees_per_radian;
            float& distance = distances[stage * bins + bin];
            distance = seen > 0
                           ? static_cast<float>(std::max(diameter, (1 + distance_rounding) * diameter / std::sin(seen)))
                           : std::numeric_limits<float>::infinity();
            if (bin > 0) distance = std::min(distance, distances[stage * bins + bin - 1]);
            if (stage > 0) distance = std::max(distance, distances[(stage - 1) * bins + bin]);
        }
    }
    return distances;
}

} // namespace unseen::perception
