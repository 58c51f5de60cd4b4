// The perceptual fold test: a fold's worst-case grating against the contrast sensitivity table.
#pragma once

#include <memory>
#include <optional>
#include <span>
#include <string_view>

#include <glm/vec2.hpp>

#include <unseen/perception/csf.h>
#include <unseen/perception/cut_rings.h>
#include <unseen/perception/display.h>
#include <unseen/perception/fold_model.h>
#include <unseen/vdtree/criteria.h>
#include <unseen/vdtree/lighting.h>

namespace unseen::vdtree {
class LightBounds;
}

namespace unseen::perception {

// What a fold can be seen against: the scene's darkest and brightest relative luminance, background included.
struct SceneLuminance {
    float darkest = 0;
    float brightest = 1;
    // What the model as a whole is seen against: its background; default: anything of the scene.
    std::optional<vdtree::LuminanceRange> behind = {};
    bool operator==(const SceneLuminance&) const = default;
};

struct FoldTestOptions {
    Display display = {};
    SceneLuminance scene = {};
    // In the window, from the top left; may lie outside. Default: foveal everywhere.
    std::optional<glm::dvec2> gaze_px = {};
    std::shared_ptr<const CsfTable> csf = {}; // shared with the criteria that look it up; default: of default_person
    // Look at colour, too, where the tree has any. The Luebke-Hallen tests then fold where
    //   sqrt((c S)^2 + (c_rg S_rg)^2 + (c_yv S_yv)^2) <= 1,
    // with the contrasts of the ring's range in both opponent directions and castleCSF's sensitivities to them. The
    // ranges are found anew for each criterion (ring_chroma(): one pass over the tree).
    bool chroma = false;
    FoldModel model = {}; // of the test by errors; the others have no factors
};

// All of these tests are in distance form. They depend on the field, the window and the options, and on whether there
// is a gaze. They do not depend on where the eye or the gaze is. Off centre the viewer's eye is taken to be before the
// point of the screen where the line of sight meets it. With an orthographic view there can be no gaze. So one criterion does for all cuts of a view that
// moves. Each fails where the display or the view is not valid, the gaze or a luminance of the scene is not finite, or
// the tree is from a damaged file.

// Luebke and Hallen 2001, section 3.3, in its safe form: extent and luminance range of the ring, facing of the dilated
// ring. For a node whose ring's sphere has the angular radius asin(r/d) on the screen:
//   theta' = max(2 asin(r/d), one pixel)
//   c      = Michelson contrast of the ring's luminance range after the display's mapping; for silhouette nodes of that
//            range united with the scene's
//   folds where  2 theta' rho* <= 1,  with S(rho*) = 1/c on the falling branch
// rho* is 0 where even the peak cannot be seen. With the eye inside the sphere nothing folds. A node is a silhouette
// where the slabs of the dilated ring do not prove that it faces the eye from one side, or the ring has an irregular
// edge.
//
// Contrast is rounded up to classes of a 48th of an octave, luminance to sixteenths of the display's range.
// Eccentricity is rounded down to quarters of a degree. The magnification is the window's largest. So a fold counts for
// no less than above, and a cut keeps about one per cent more triangles at most. With the chroma classes are coarser.
//
// Cost: 100 ns a node, and 90 ns for every class in use and eccentricity; bunny: 7 ms, and 35 ms with a gaze. Fails,
// too, where the chroma is asked for of a tree with a texture, whose colours are not looked at; so does the next.
Result<vdtree::DistanceCriterion> luebke_hallen_distances(const vdtree::VertexTree& tree, const vdtree::View& view,
                                                          const FoldTestOptions& options);

// The same with the remaining holes closed. What is tested is not the mesh's ring but all that the ring can be in any
// cut, and the mean. Let hat R and hat r be the luminances and the radius of bound_cut_rings(), which contain the
// ring's, r0 the support's radius, r1 the ring's, and m the shift of the mean:
//   theta' = max(2 asin(max(r1, (r0 + hat r) / 2) / d), one pixel)
//   c      = Michelson contrast of hat R, for silhouettes united with the scene's range
//   folds where  c S(1 / (2 theta')) <= 1  and  m / L S_peak <= 1, L the middle of hat R
// A fold costs at least what it does above, for every node. Cost: as the above.
Result<vdtree::DistanceCriterion> luebke_hallen_safe_distances(const vdtree::VertexTree& tree, const CutRings& rings,
                                                               const vdtree::View& view,
                                                               const FoldTestOptions& options);

// luebke_hallen_distances() under lights that may move. Ranges are what the lights can make of the normals, albedos and
// places in a ring, and follow the lighting of the viewpoint. Silhouettes are those of `options.scene`, which must hold
// for all of it (see lit_scene()). Adaptation is to the brightest luminance of a range. `bounds`: of the tree. Cost:
// some 20 ms with a gaze, less without; not by node.
Result<vdtree::DistanceCriterion> lit_distances(const vdtree::VertexTree& tree,
                                                std::shared_ptr<const vdtree::LightBounds> bounds,
                                                const vdtree::View& view, const FoldTestOptions& options);

// luebke_hallen_safe_distances() under lights that may move: ranges are what the lights can make of all that the ring
// can be in any cut. `rings`: of the tree; `bounds`: from bound_lit_cut_rings() of these. What it leaves open: shifts of
// the mean, which depend on the light. Cost: some 60 ms with a gaze, less without, and 10 ns a node.
Result<vdtree::DistanceCriterion> lit_safe_distances(const vdtree::VertexTree& tree, const CutRings& rings,
                                                     std::shared_ptr<const vdtree::LightBounds> bounds,
                                                     const vdtree::View& view, const FoldTestOptions& options);

// Between which luminances everything under the lights is, and the background. Rounded outward to steps of 1/32, so
// that it mostly stays while lights move. `eye`: in the tree's frame.
SceneLuminance lit_scene(const vdtree::VertexTree& tree, const vdtree::LightBounds& bounds,
                         const vdtree::Lighting& lighting, glm::dvec3 eye, float background);

// The test by errors: what a fold changes in fact, not what could change within its ring. In distance form, like the
// above. Fails, too, where the tree's folds have not been measured (measure_folds()), and where what files say of it is
// no measurement.
//
// The model makes of the measurement (perception/fold_model.h): a distance h and a luminance e, the largest, and their
// means hm and em. D is the angular width of what changes: twice the larger of the support's radius and the extent. The
// ring has luminances lo..hi, with L in their middle, and a sphere of radius r1. Luminances are in cd/m2. S is the
// table's conservative form, by eccentricity. A band of an octave around rho sees c(rho) S(rho) of a pattern. The
// pattern is invisible where the sum of these, each to the power of 3.5, is less than 1:
//   patch       c = (em + (hi - lo) min(1, 1.6 hm / r1)) / L, and in parts half as wide four times that, up to the
//               largest, (e + (hi - lo) min(1, h / r1)) / L;
//               c(rho) = c max over n = 1, 2, 4 of min(1, (n D rho)^2) / n
//   bias        of areas W = 2^k D, k = 1 up to the mesh's size:  c = bias / 2^(k fading / 2);
//               c(rho) = c min(1, (W rho)^2)
//   silhouette  a strip of width w, the angle of h plus 0.011 pixel, at most twice that of h. It changes between the
//               ring's luminance and anything in the scene, with the contrast cs over the pair's mean:
//               c(rho) = cs min(1, 2 rho w)
// rho goes up to the display's limit: below a pixel a fold counts by the share of the pixel that it covers. So from far
// enough away everything folds, and drawing must be antialiased.
//
// Where the mesh was measured in stages, too, a node also folds from where nobody can tell the whole mesh from the mesh
// in the node's stage, by pictures of both. That is seldom near, but most of it far away.
//
// Measured, not proven: see docs/evidence.md for where it fails. Open and irregular rings are silhouettes. Cost: as
// luebke_hallen_distances().
Result<vdtree::DistanceCriterion> error_distances(const vdtree::VertexTree& tree, const vdtree::View& view,
                                                  const FoldTestOptions& options);

// The same under lights of which some cast shadows: whichever of these are hidden from a node, and with their shadows'
// edges across it. `as_lit`: the tree under all lights (LitFolds::under()), and then without each set of those that may
// be hidden, each with the lights that are left. An edge of a shadow moves with the surface that it falls on, by what that moves times the
// tangent to the light, and takes E times the cosine of the light: the product counts as a change of the ring's light.
// What the node's own outline does to shadows is not looked at: see ShadowEdges. Cost: as often as there are trees.
struct TreeAsLit {
    vdtree::VertexTree tree;
    vdtree::Lighting lighting;
};
Result<vdtree::DistanceCriterion> error_distances(std::span<const TreeAsLit> as_lit, const vdtree::View& view,
                                                  const FoldTestOptions& options);

// Where the eye and the gaze are in the tree's frame. With the view's frustum if `window_only`: what lies outside
// folds. The same as vdtree's, but for the gaze. (For a stereo pair: vdtree::viewpoint_of_pair(), without a gaze.)
vdtree::Viewpoint viewpoint_of(const vdtree::VertexTree& tree, const vdtree::View& view, const FoldTestOptions& options,
                               const vdtree::Similarity& placement = {}, bool window_only = true);

} // namespace unseen::perception
