#include "effects.h"

#include <cmath>
#include <cstdio>

#include <glm/geometric.hpp>

#include "terminal.h"

namespace unseen::app {
namespace {

// The default field is the physical one, computed by way of degrees: rounding is no magnification.
constexpr double same_field_degrees = 1e-7;

Effect fold_test_effect(const WhatOptions& what) {
    if (what.mode == Mode::full) return {"fold test", false, "nothing is folded in the full model"};
    const std::string instead = what.chosen && !what.chosen->why.empty() ? " (" + what.chosen->why + ")" : std::string();
    if (what.test() == FoldTest::error)
        return {"fold test", true, "error: what each fold changes in luminance and outline, against the contrast sensitivity"};
    if (what.test() == FoldTest::luebke_hallen_safe)
        return {"fold test", true,
                "luebke-hallen-safe: the worst grating of each fold with any neighbours folded, and the shift of the mean, against the contrast "
                "sensitivity" + instead};
    if (what.test() == FoldTest::luebke_hallen)
        return {"fold test", true, "luebke-hallen: the worst grating of each fold against the contrast sensitivity" + instead};
    return {"fold test", true, name_of(what.test()) + ": pixels on the screen, whether they can be seen or not"};
}

Effect gaze_effect(const WhatOptions& what) {
    if (what.mode == Mode::full) return {"gaze", false, "nothing is folded in the full model"};
    if (!is_perceptual(what)) return {"gaze", false, "the fold test " + name_of(what.test()) + " does not use it"};
    if (!what.gaze_px) return {"gaze", false, "no gaze is given, so everything counts as looked at"};
    const std::string around =
        what.gaze_margin_deg > 0 ? ", give or take " + rounded(what.gaze_margin_deg, 3) + " degrees," : std::string(",");
    return {"gaze", true,
            "the viewer looks at pixel " + rounded(what.gaze_px->x, 6) + " from the left and " + rounded(what.gaze_px->y, 6) + " from the top" + around +
                " and sees less sharply elsewhere"};
}

Effect silhouette_effect(const Scene& scene, const WhatOptions& what) {
    if (!is_perceptual(what)) return {"silhouettes", false, "only the perceptual fold test knows them"};
    const perception::SceneLuminance range = scene_luminance(scene);
    const auto cdm2 = [&](float relative) {
        return rounded(perception::to_luminance(scene.display, static_cast<double>(relative)).value(), 3);
    };
    return {"silhouettes", true,
            "folds on outlines are tested against " + cdm2(range.darkest) + " to " + cdm2(range.brightest) +
                " cd/m2, the whole scene with its background"};
}

Effect csf_effect(const Scene& scene, const WhatOptions& what) {
    if (!is_perceptual(what)) return {"csf table", false, "only the perceptual fold test looks sensitivity up"};
    return {"csf table", scene.csf != nullptr,
            scene.csf ? "by --csf: " + scene.csf->samples().source
                      : "the standard observer is used, castleCSF"};
}

Effect prelit_effect(const Scene& scene) {
    if (scene.lighting && !scene.tree.colours().empty()) return {"pre-lit colours", false, "--lights lights the colours"};
    if (scene.tree.is_prelit())
        return {"pre-lit colours", true, scene.tree.colours().empty() ? "the texture is taken as lit" : "the mesh's colours are taken as lit"};
    if (!scene.tree.texture().empty()) return {"pre-lit colours", false, "--light or --ambient lights the texture"};
    return {"pre-lit colours", false,
            scene.tree.colours().empty() ? "the mesh has no colours" : "--light or --ambient lights the colours"};
}

Effect texture_effect(const Scene& scene, const WhatOptions& what) {
    if (scene.tree.texture().empty())
        return {"texture", false, scene.is_texture_left_out ? "--no-texture leaves it out" : "the model has none"};
    if (!is_perceptual(what)) return {"texture", true, "drawn; folds are not tested against it"};
    if (what.test() == FoldTest::luebke_hallen_safe)
        return {"texture", true, "folds are tested against its darkest and brightest texels around them, and by how far they move it"};
    return {"texture", true, "folds are tested against its darkest and brightest texels around them"};
}

Effect chroma_effect(const Scene& scene, const WhatOptions& what) {
    if (!is_perceptual(what)) return {"chroma", false, "only the perceptual fold test knows it"};
    if (!what.chroma) return {"chroma", false, "without --chroma only luminance counts"};
    if (scene.tree.ring_chroma().empty()) return {"chroma", false, "nothing has any colour"};
    return {"chroma", true, "red-green and yellow-violet contrast count beside that of luminance, by castleCSF"};
}

Effect light_effect(const Scene& scene, const WhatOptions& what) {
    if (scene.lighting)
        return {"light", true,
                scene.rig->description() +
                    (is_perceptual(what) ? ": folds are tested against what these can make of the normals and places in their rings"
                                         : "; drawn, for the fold test does not look at luminance")};
    if (scene.is_relit)
        return {"light", true, "luminance and its bounds were computed again for another light than the tree's"};
    return {"light", false,
            scene.tree.is_prelit() ? "the colours are pre-lit" : "the light that the tree was built for"};
}

Effect frustum_effect(const WhatOptions& what, Purpose purpose) {
    if (what.mode == Mode::full) return {"frustum culling", false, "nothing is folded in the full model"};
    if (purpose == Purpose::mesh) return {"frustum culling", false, "the mesh may be looked at from elsewhere"};
    return {"frustum culling", true, "what lies outside of the window is folded"};
}

Effect culling_effect(const Scene& scene, Purpose purpose) {
    const PlacedSphere sphere = placed_sphere(scene.tree, scene.placement);
    const bool is_open = scene.tree.closedness() == vdtree::Closedness::open;
    const bool is_outside = glm::length(scene.view.eye - sphere.centre) > sphere.radius;
    if (purpose == Purpose::mesh) return {"back-face culling", false, "nothing is drawn"};
    if (is_open) return {"back-face culling", false, "the surface is open, so both sides are drawn"};
    if (!is_outside) return {"back-face culling", false, "the eye is in the model, so both sides are drawn"};
    return {"back-face culling", true,
            scene.tree.closedness() == vdtree::Closedness::closed_outward
                ? "the surface is closed, so its inner side cannot be seen"
                : "the surface is closed but inside out, so it is turned"};
}

Effect magnification_effect(const Scene& scene, const WhatOptions& what) {
    const double physical = perception::physical_field(scene.display, scene.view.height).value();
    const std::string fields =
        rounded(scene.view.fov_y_degrees, 4) + " degrees, the window fills " + rounded(physical, 4);
    if (std::abs(scene.view.fov_y_degrees - physical) <= same_field_degrees)
        return {"magnification", false, "the camera's field is the one that the window fills on the display"};
    if (!is_perceptual(what)) return {"magnification", false, "pixels do not depend on it (camera " + fields + ")"};
    return {"magnification", true, "the camera's field is " + fields + ": angles are those on the screen"};
}

Effect distance_effect(const WhatOptions& what, const CutFacts& facts) {
    const std::string name = "imperceptible distance";
    if (what.mode == Mode::full) return {name, true, "nothing is folded, so it holds from any distance"};
    if (!is_perceptual(what))
        return {name, false, "costs of the fold test " + name_of(what.test()) + " are no distances"};
    if (std::isinf(facts.imperceptible_from_m))
        return {name, false, "a fold around the eye or across its plane stays visible from everywhere"};
    if (facts.threshold) return {name, true, "the display's distance times " + rounded(*facts.threshold, 4) + ", above which no fold costs"};
    return {name, true, "the display's distance times the largest fold cost"};
}

Effect back_face_effect(const Scene& scene, Purpose purpose) {
    if (purpose == Purpose::mesh) return {"back-face folding", false, "the mesh may be looked at from elsewhere"};
    if (culls_back_faces(scene)) return {"back-face folding", true, "what faces away is not drawn, so it is folded"};
    if (scene.tree.closedness() == vdtree::Closedness::open)
        return {"back-face folding", false, "the surface is open"};
    if (is_translucent(scene)) return {"back-face folding", false, "what faces away may show through"};
    return {"back-face folding", false, "the eye is in the model"};
}

Effect hidden_effect(const Scene& scene, const WhatOptions& what, Purpose purpose, std::size_t occluders) {
    const std::string name = "hidden folding";
    if (purpose == Purpose::mesh) return {name, false, "the mesh may be looked at from elsewhere"};
    if (!folds_hidden(scene, what, purpose))
        return {name, false, is_perceptual(what) ? "nothing solid is looked at from outside" : "only the perceptual fold tests know what a fold changes"};
    if (occluders == 0) return {name, false, "no sphere fits into the solid"};
    return {name, true, "what is behind one of " + std::to_string(occluders) + " spheres inside the solid is folded"};
}

Effect translucency_effect(const Scene& scene, const WhatOptions& what) {
    if (!is_perceptual(what)) return {"translucency", false, "only the perceptual fold test knows it"};
    if (!is_translucent(scene)) return {"translucency", false, "no vertex has an alpha below 1"};
    return {"translucency", true, "where a vertex has an alpha below 1, anything in the scene may show through"};
}

Effect time_limit_effect(const WhatOptions& what, const CutFacts& facts) {
    if (!what.milliseconds) return {"time limit", false, "none is given"};
    return {"time limit", true,
            facts.is_complete ? "the cut was made within it" : "it ended the cut; the worst folds were undone first"};
}

} // namespace

std::vector<Effect> effects_of(const Scene& scene, const WhatOptions& what, Purpose purpose, const CutFacts& facts) {
    std::vector<Effect> effects = {fold_test_effect(what),
                                   gaze_effect(what),
                                   silhouette_effect(scene, what),
                                   csf_effect(scene, what),
                                   chroma_effect(scene, what),
                                   translucency_effect(scene, what),
                                   texture_effect(scene, what),
                                   prelit_effect(scene),
                                   light_effect(scene, what),
                                   frustum_effect(what, purpose),
                                   culling_effect(scene, purpose),
                                   magnification_effect(scene, what),
                                   distance_effect(what, facts)};
    if (!facts.occluders) return effects;
    effects.push_back(back_face_effect(scene, purpose));
    effects.push_back(hidden_effect(scene, what, purpose, *facts.occluders));
    effects.push_back(time_limit_effect(what, facts));
    return effects;
}

Effect geomorph_effect(const vdtree::Geomorph* geomorph, const vdtree::Cut& cut) {
    if (!geomorph) return {"geomorphs", false, "vertices do not glide unless --geomorph says for how long"};
    return {"geomorphs", true,
            "vertices glide for " + rounded(geomorph->seconds(), 3) + " s; " + grouped(geomorph->moved().size()) + " do now, and " +
                grouped(geomorph->drawn().triangle_count() - cut.triangle_count()) + " triangles wait for them to be folded"};
}

Json to_json(std::span<const Effect> effects) {
    Json json = Json::array();
    for (const Effect& effect : effects) json.push_back({{"name", effect.name}, {"on", effect.on}, {"why", effect.why}});
    return json;
}

void print(std::span<const Effect> effects) {
    for (const Effect& effect : effects)
        std::printf("  %-3s  %s: %s\n", effect.on ? "on" : "off", effect.name.c_str(), effect.why.c_str());
}

} // namespace unseen::app
