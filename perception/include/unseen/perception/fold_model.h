// The factors of the test by errors: what is made of a measurement when a criterion is made. Files hold none of them.
// But the order in which a measurement adds folds up goes by wide_luminance (src/fold/fold_errors.h), with the default
// values: other defaults of amplitude_of_point_mean, longest_ring or most_side_by_side are another
// measurement::revision.
//
// The values were chosen by comparing pictures of views that nobody recorded. `unseen-bench fit` holds them against a
// tuning set, meshes and views of its own that are in no other table of docs/evidence.md, and tells what other values
// keep and show there. "Fitted" means that with weaker values something is seen on the tuning set, and with this one
// nothing. The others it does not tell: no value that it tries is seen.
#pragma once

#include <array>

#include <unseen/perception/units.h>
#include <unseen/vdtree/result.h>

namespace unseen::perception {

struct FoldModel {
    // ---- distances

    // The largest shift of an outline, over the largest mean of shifts over a seventh of the fold's width: 1.15 of a
    // ridge as wide as the fold, 1.28 of a cone.
    double peak_of_shift = 1.2;
    // An outline moves with the folds beside it, too: times the largest distance of a point. Two independent shifts of
    // one size come to sqrt 2.
    double moved_by_neighbours = 1.4;
    // Parts of the surface that are nearer to each other than so many times the distance by which folds move them may
    // pass through each other. Both parts move, each with its neighbours. Fitted from below: on the tuning set of
    // `unseen-bench fit` 1.5 would do, and none shows pixels.
    double contact_reach = 6;
    // Sine of the angle at which parts meet: the line where one hides the other moves by 1 / sine; flatter ones count
    // as this. Fitted from below: on the tuning set 0.4 would do, and 1 shows pixels.
    double least_sine = 0.1;
    // Pixels. A picture of 64 samples a pixel tells no finer shifts of an outline than about this, two thirds of the
    // step of one sample, 1/64. Where pixels are so coarse that half of what can be seen is less, it would take more
    // samples, not more triangles. Fitted: `unseen-bench fit`, tuning set.
    double sampled_shift_px = 0.011;

    // ---- amplitudes

    // Of a grating, by the mean difference of points. A sine's is pi / 2 = 1.57 times its mean; more, for neighbours
    // err alike.
    double amplitude_of_point_mean = 1.9;
    // By the mean distance that shifts what a ring shows. Derived: a sine's, pi / 2, rounded up.
    double amplitude_of_shift_mean = 1.6;
    // Rings of a larger radius, in widths of what changes, reach beyond their pictures: points count, too. The larger
    // picture's half side is 2.1 widths: of the square around a ring of 4 it shows a quarter.
    double longest_ring = 4;
    // Patches side by side whose signs differ at random are seen as 1 / n of the contrast at n times the width, up to
    // this n: 1, 2, 4, ... What more of them come to, the bias tells.
    int most_side_by_side = 4;
    // Of contrasts on textured surfaces: textures change all over at once, where of other surfaces few nodes change as
    // much as they can. Chosen on the textured models of the tests: with 1, noise aside is seen by one judge of two.
    double contrast_of_textures = 1.3;
    // Of the contrasts of pictures of the whole mesh: the worst direction may lie between those of the pictures. Of
    // these 26, one is within 31 degrees of any; foreshortening by that angle is 1.16.
    double between_directions = 1.15;

    // ---- sensitivity

    // Patches lie among others like them, and what they come to is summed over space, whatever their signs. So a patch
    // is seen as well as a grating in a disc of so many times its width, by the law of area (summation_gain()). Fitted:
    // the least with which nothing is seen, regular patterns included.
    double neighbourhood = 6;
    // How much of the observer's sensitivity the test needs, by eccentricity; linear between, beyond as at the last.
    // Less than all is enough aside: the table takes frequencies below the peak to be seen as well as the peak, which
    // lies at the lowest frequencies there; a node counts as where it is nearest to the gaze; and fewer folds have their
    // chance of being the worst, for nodes are larger. Fitted.
    static constexpr std::array<double, 4> needed_at_degrees = {0, 12, 29, 50};
    std::array<double, 4> needed = {1, 0.95, 0.6, 0.5}; // must not rise
    // By areas whose light shifts together: the shift is the largest from any direction, and counts as if all of the
    // area shifted as its nodes do in the mean. Fitted.
    double needed_by_areas = 0.5;
    // By outlines, wherever they are. They count as long straight strips, all of which move by the largest shift and
    // towards the darkest or brightest that may be behind. Along a true outline shifts change their signs from node to
    // node. Where it moves by an eighth of the mesh's radius and more, as where a part vanishes, all is needed. Fitted.
    double needed_by_outlines = 0.3;
    // By open borders: a border may be made so that all of it shifts alike, as that of many equal holes. Fitted.
    double needed_by_borders = 0.5;

    static constexpr int largest_side_by_side = 64;

    bool operator==(const FoldModel&) const = default;
};

// By FoldModel::needed. Precondition: not NaN.
double needed_sensitivity(const FoldModel& model, Degrees eccentricity);

// Factors must be finite and 0 or more, and most_side_by_side from 1 to largest_side_by_side.
Result<void> validate(const FoldModel& model);

} // namespace unseen::perception
