// The perceptual fold tests: from how far an observer cannot see that nodes are folded.
#pragma once

#include <unseen/perception/csf.h>
#include <unseen/perception/display.h>
#include <unseen/vdtree/criteria.h>
#include <unseen/vdtree/depth_picture.h>

namespace unseen::vdtree {
class LightBounds;
}

namespace unseen::perception {

struct CutRings; // of bound_cut_rings()

// What a fold can be seen against: the darkest and brightest relative luminance of the scene and its background.
struct SceneLuminance {
    float darkest = 0;
    float brightest = 1;
    // What the model as a whole is seen against; default: anything in the scene.
    std::optional<vdtree::LuminanceRange> behind = {};
    // How far apart the colours in it are, as a difference of luminance that is seen as well (colour_reach()); what the
    // tree itself shows counts in any case.
    float colour = 0;
    bool operator==(const SceneLuminance&) const = default;
};

// The factors of the fold test by errors that are set by what is seen: with weaker values something shows on the tuning
// set of `unseen-bench fit`. Files hold none of them.
struct FoldModel {
    // Parts nearer to each other than this times the distance by which folds move them may pass through each other: both
    // move, each with its neighbours. 1.5 shows pixels.
    double contact_reach = 6;
    // The least sine of the angle at which parts meet: the line where one hides the other moves by 1 / sine. 1 shows
    // pixels.
    double least_sine = 0.1;
    // A patch lies among others like it, so it is seen as well as a grating in a disc of this many times its width
    // (summation_gain()). 2 shows pixels.
    double neighbourhood = 6;
    // The share of the observer's sensitivity that the test needs, by eccentricity, linear in between. Less than all is
    // enough aside: the table takes frequencies below the peak to be seen as well as the peak, a node counts as where
    // it is nearest to the gaze, and fewer, larger nodes have their chance of being the worst. With 0.2 at 50 degrees
    // changes reach the threshold.
    static constexpr std::array<double, 4> needed_at_degrees = {0, 12, 29, 50};
    std::array<double, 4> needed = {1, 0.95, 0.6, 0.5}; // must not rise
    // The same for outlines, which count as long straight strips that move by the largest shift and towards the darkest
    // or brightest background, though true shifts change their signs from node to node. If an outline moves by an
    // eighth of the mesh's radius or more, as when a part vanishes, all is needed. 0.1 shows pixels.
    double needed_by_outlines = 0.3;

    bool operator==(const FoldModel&) const = default;
};

// By FoldModel::needed. Precondition: not NaN.
double needed_sensitivity(const FoldModel& model, Degrees eccentricity);

// Factors must be finite and 0 or more; the neighbourhood and needed shares above 0.
Result<void> validate(const FoldModel& model);

struct FoldTestOptions {
    Display display = {};
    SceneLuminance scene = {};
    // In the window, from the top left; may lie outside. Default: foveal everywhere.
    std::optional<glm::dvec2> gaze_px = {};
    std::shared_ptr<const CsfTable> csf = {}; // shared with the criteria that look it up; default: of default_person
    FoldModel model = {};                     // factors of the test by errors
};

// All tests are in distance form. A criterion depends on the field, the window, the options, and on whether there is a
// gaze, but not on where the eye or the gaze is: one serves all cuts of a view that moves. In shifted views the viewer's
// eye is before the point where the line of sight meets the screen; orthographic views cannot have a gaze. Each test
// fails on an invalid display or view, a gaze or luminance that is not finite, and a tree from a damaged file.

// Luebke and Hallen 2001, section 3.3, in its safe form: extent and luminance range of the ring, facing of the dilated
// ring. For a node whose ring's sphere has the angular radius asin(r/d) on the screen:
//   theta' = max(2 asin(r/d), one pixel)
//   c      = Michelson contrast of the ring's luminance range after the display's mapping; for silhouette nodes of that
//            range united with the scene's
//   folds where  2 theta' rho* <= 1,  with S(rho*) = 1/c on the falling branch
// rho* is 0 if even the peak cannot be seen. With the eye inside the sphere nothing folds. A node is a silhouette
// unless the slabs of the dilated ring prove that it faces the eye from one side, and if the ring has an irregular
// edge.
//
// Contrast is rounded up to a 48th of an octave, luminance to sixteenths of the display's range, eccentricity down to
// quarters of a degree; the magnification is the window's largest. So a fold costs no less than above, and a cut keeps at
// most about one per cent more triangles.
//
// Where vertices have colours and there is no texture, both Luebke-Hallen tests fold where
//   sqrt((c S)^2 + (c_rg S_rg)^2 + (c_yv S_yv)^2) <= 1,
// with the contrasts of the ring's range in both opponent directions and castleCSF's sensitivities to them. Classes are
// coarser then. The colours of textures are not looked at.
//
// Cost: 100 ns a node, and 90 ns for every class in use and eccentricity; bunny: 7 ms, and 35 ms with a gaze.
Result<vdtree::DistanceCriterion> luebke_hallen_distances(const vdtree::VertexTree& tree, const vdtree::View& view,
                                                          const FoldTestOptions& options);

// The same with the remaining holes closed: it tests all that the ring can be in any cut, not the mesh's ring, and the
// mean. Let hat R and hat r be the luminances and the radius of bound_cut_rings(), which contain the
// ring's, r0 the support's radius, r1 the ring's, and m the shift of the mean:
//   theta' = max(2 asin(max(r1, (r0 + hat r) / 2) / d), one pixel)
//   c      = Michelson contrast of hat R, for silhouettes united with the scene's range
//   folds where  c S(1 / (2 theta')) <= 1  and  m / L S_peak <= 1, L the middle of hat R
// A fold never costs less than above. Cost: as above.
Result<vdtree::DistanceCriterion> luebke_hallen_safe_distances(const vdtree::VertexTree& tree, const CutRings& rings,
                                                               const vdtree::View& view,
                                                               const FoldTestOptions& options);

// luebke_hallen_distances() under lights that may move. Luminance ranges are what the lights can make of the normals,
// albedos and places in a ring, and follow the lighting of the viewpoint. Silhouettes are seen against `options.scene`,
// which must hold for the whole path (see lit_scene()). The eye adapts to the brightest luminance of a range. `bounds`:
// of the tree. Cost: some 20 ms with a gaze, less without; not by node.
Result<vdtree::DistanceCriterion> lit_distances(const vdtree::VertexTree& tree,
                                                std::shared_ptr<const vdtree::LightBounds> bounds,
                                                const vdtree::View& view, const FoldTestOptions& options);

// luebke_hallen_safe_distances() under lights that may move: luminance ranges are what the lights can make of all that
// the ring can be in any cut. `rings`: of the tree. `bounds`: bound_lit_cut_rings() of these. It does not bound shifts
// of the mean, which depend on the light. Cost: some 60 ms with a gaze, less without, and 10 ns a node.
Result<vdtree::DistanceCriterion> lit_safe_distances(const vdtree::VertexTree& tree, const CutRings& rings,
                                                     std::shared_ptr<const vdtree::LightBounds> bounds,
                                                     const vdtree::View& view, const FoldTestOptions& options);

// The luminance range of the tree under the lights and of the background, rounded outward to steps of 1/32, so that it
// rarely changes while lights move. `eye`: in the tree's frame.
SceneLuminance lit_scene(const vdtree::VertexTree& tree, const vdtree::LightBounds& bounds,
                         const vdtree::Lighting& lighting, glm::dvec3 eye, float background);

// The test by errors: by what a fold changes in fact, not what could change within its ring. Also fails if the tree's
// folds have not been measured (measure_folds()), or if the measurement is damaged.
//
// From the measurement the model derives the largest shift h and change of luminance e, and their means hm and em. D is
// the angular width of what changes: twice the larger of the support's radius and the extent. The ring has luminances
// lo..hi, cd/m2, L in their middle, and a sphere of radius r1. S is the table's conservative form, by eccentricity. A
// band of an octave around rho sees c(rho) S(rho) of a pattern. The pattern is invisible if the sum of these, each to
// the power of 3.5, is less than 1:
//   patch       c = (em + (hi - lo) min(1, 1.6 hm / r1)) / L, and in parts half as wide four times that, up to the
//               largest, (e + (hi - lo) min(1, h / r1)) / L;
//               c(rho) = c max over n = 1, 2, 4 of min(1, (n D rho)^2) / n
//   bias        of areas W = 2^k D, k = 1 up to the mesh's size:  c = bias / 2^(k fading / 2);
//               c(rho) = c min(1, (W rho)^2)
//   silhouette  a strip of width w, the angle of h plus 0.011 pixel, at most twice that of h. It changes between the
//               ring's luminance and anything in the scene, with the contrast cs over the pair's mean:
//               c(rho) = cs min(1, 2 rho w)
// rho goes up to the display's limit: below a pixel a fold counts by the share of the pixel that it covers. So far
// enough away everything folds, and drawing must be antialiased.
//
// If the mesh was measured in stages, a node also folds where pictures show that nobody can tell the whole mesh from
// the mesh in the node's stage. This decides most folds far away, and few near by.
//
// Measured, not proven: docs/evidence.md says where it fails. Open and irregular rings are silhouettes.
Result<vdtree::DistanceCriterion> error_distances(const vdtree::VertexTree& tree, const vdtree::View& view,
                                                  const FoldTestOptions& options);

// The same under lights that may cast shadows, for any of them hidden from a node, and for edges of shadows across it.
// `as_lit`: the tree under all lights (LitFolds::under()), and then without each set of lights that may be hidden, each
// with the lights that are left. The edge of a shadow moves with the surface that it falls on, by the surface's shift
// times the tangent of the angle to the light, and changes light by E times the cosine: the product counts as a change
// of the ring's light. What the node's own outline does to shadows is not included: see ShadowEdges. Cost: once for
// each tree.
struct TreeAsLit {
    vdtree::VertexTree tree;
    vdtree::Lighting lighting;
};
Result<vdtree::DistanceCriterion> error_distances(std::span<const TreeAsLit> as_lit, const vdtree::View& view,
                                                  const FoldTestOptions& options);

// For budgets of one picture, by interior node: what folds cost by the errors that add up in it, in units of the costs of
// error_distances(). They are at least a node's own, do not grow from a node to its children, and nodes of which nothing
// is shown cost nothing. A budget is met best by costs that are the larger of the two, see vdtree::costing_at_least(): the
// picture's error is then least, and nothing sticks out.
//
// Folding a node errs, in squared relative luminance times square pixels, by
//     A (m^2 + b^2 v) + max(0.03, v) b^2 h l:
// A and l are the area and the outline that are shown of it, m the mean difference of luminance, h the shift in pixels, b
// the difference between its own luminance and what may be behind, and v, from 0 to 1, how much of it vanishes. Prices of
// triangles follow by optimal pruning; a cost goes with their root, as errors go with the square of a distance.
//
// `tree`: as it is lit, with its measurement. `shown`: vdtree::find_shown(). Fails like error_distances(), and on
// orthographic views. Cost: some 200 ns a node.
Result<std::vector<float>> summed_costs(const vdtree::VertexTree& tree, const vdtree::ShownParts& shown,
                                        const vdtree::View& view, const vdtree::Similarity& placement,
                                        const FoldTestOptions& options);

// The eye and the gaze in the tree's frame, like vdtree's, which has no gaze. If `window_only`, with the view's
// frustum, outside of which everything folds.
vdtree::Viewpoint viewpoint_of(const vdtree::VertexTree& tree, const vdtree::View& view, const FoldTestOptions& options,
                               const vdtree::Similarity& placement = {}, bool window_only = true);

} // namespace unseen::perception
