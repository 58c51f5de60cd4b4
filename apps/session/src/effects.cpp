#include <unseen/perception/internal/chroma.h>

#include "effects.h"

#include <algorithm>
#include <cmath>

#include <glm/geometric.hpp>

#include <unseen/perception/internal/motion.h>

#include <unseen/vdtree/internal/light_bounds.h>
#include <unseen/vdtree/internal/number_format.h>

namespace unseen::session {
namespace {

// The default field is the physical one, computed by way of degrees: rounding is no magnification.
constexpr double same_field_degrees = 1e-7;

bool is_full(const Decision& decision) { return decision.request.goal.kind == Goal::Kind::full; }

Effect fold_test_effect(const Sight& sight, const Decision& decision) {
    if (is_full(decision)) return {"fold test", false, "nothing is folded in the full model"};
    return {"fold test", true,
            name_of(decision.test) + ": " + what_it_looks_at(sight, decision.test) +
                (decision.why.empty() ? "" : " (" + std::string(decision.why) + ")")};
}

// Without commas in thousands, for a comma parts the coordinates of a pixel.
std::string to_tenths(double px) { return shortest(std::round(10 * px) / 10); }

Effect gaze_effect(const Sight& sight, const Decision& decision) {
    if (is_full(decision)) return {"gaze", false, "nothing is folded in the full model"};
    if (!is_perceptual(decision))
        return {"gaze", false, "the fold test " + name_of(decision.test) + " does not use it"};
    const std::optional<Gaze>& gaze = sight.observer.gaze;
    if (!gaze) return {"gaze", false, "no gaze is given, so everything counts as looked at"};
    const std::string around =
        gaze->margin_deg > 0 ? ", give or take " + rounded(gaze->margin_deg, 3) + " degrees," : std::string(",");
    return {"gaze", true,
            "the viewer looks at pixel " + to_tenths(gaze->px.x) + ", " + to_tenths(gaze->px.y) + around +
                " and sees less sharply elsewhere"};
}

Effect silhouette_effect(const Sight& sight, const Decision& decision) {
    if (!is_perceptual(decision)) return {"silhouettes", false, "only the perceptual fold test knows them"};
    const perception::SceneLuminance& range = sight.luminance;
    const auto cdm2 = [&](float relative) {
        return rounded(perception::to_luminance(sight.observer.display, static_cast<double>(relative)).value(), 3);
    };
    return {"silhouettes", true,
            "folds on outlines are tested against " + cdm2(range.darkest) + " to " + cdm2(range.brightest) +
                " cd/m2, the whole scene with its background"};
}

Effect csf_effect(const Sight& sight, const Decision& decision) {
    if (!is_perceptual(decision)) return {"csf table", false, "only the perceptual fold test looks sensitivity up"};
    return {"csf table", sight.observer.csf != nullptr, describe(sight.observer)};
}

Effect motion_effect(const Sight& sight, const Decision& decision) {
    if (!is_perceptual(decision)) return {"motion", false, "only the perceptual fold test knows it"};
    if (sight.observer.velocity <= perception::least_velocity)
        return {"motion", false, Message::of("without {observer.velocity} everything counts as still on the retina")};
    return {
        "motion", true,
        "everything counts as moving over the retina at " + rounded(sight.observer.velocity.value(), 3) +
            " degrees/s, where fine things blur and coarse ones are seen better; what stands still, or what the eye "
            "follows, is seen more finely than that"};
}

// Where in the window, and between which luminances, the table has no samples.
Effect reach_effect(const Sight& sight, const Decision& decision) {
    const std::string name = "beyond the csf table";
    if (!is_perceptual(decision)) return {name, false, "only the perceptual fold test looks sensitivity up"};
    const perception::Display& display = sight.observer.display;
    double farthest = 0; // degrees
    if (sight.gaze_px) {
        const double distance_px = display.distance / display.pixel_pitch;
        const auto direction = [&](double x, double y) {
            return glm::normalize(glm::dvec3(glm::dvec2(x, y) - vdtree::axis_px(sight.view), distance_px));
        };
        const glm::dvec3 gaze = direction(sight.gaze_px->x, sight.gaze_px->y);
        for (const double x : {0.0, double(sight.view.width)})
            for (const double y : {0.0, double(sight.view.height)}) {
                const glm::dvec3 corner = direction(x, y);
                farthest =
                    std::max(farthest, perception::degrees_per_radian *
                                           std::atan2(glm::length(glm::cross(gaze, corner)), glm::dot(gaze, corner)));
            }
    }
    const auto light = [&](float relative) { return perception::to_luminance(display, static_cast<double>(relative)); };
    const std::string beyond = perception::beyond_reach(
        *sight.csf, perception::Degrees(farthest), light(sight.luminance.darkest), light(sight.luminance.brightest));
    if (beyond.empty()) return {name, false, "the table reaches as far as the window and its light do"};
    return {name, true, beyond};
}

Effect prelit_effect(const Sight& sight) {
    if (sight.lighting && !sight.object.tree.colours().empty())
        return {"pre-lit colours", false, Message::of("{scene.lights} lights the colours")};
    if (sight.object.tree.is_prelit())
        return {"pre-lit colours", true,
                sight.object.tree.colours().empty() ? "the texture is taken as lit"
                                                    : "the mesh's colours are taken as lit"};
    if (sight.object.tree.colours().empty() && sight.object.tree.texture().empty())
        return {"pre-lit colours", false, "the mesh has no colours"};
    return {"pre-lit colours", false, "colours are reflectance, and are lit"};
}

Effect texture_effect(const Sight& sight, const Decision& decision) {
    if (sight.object.tree.texture().empty())
        return {"texture", false,
                sight.object.texture_left_out ? Message::of("{load.without_textures} leaves it out")
                                              : Message("the model has none")};
    if (!is_perceptual(decision)) return {"texture", true, "drawn; folds are not tested against it"};
    if (decision.test == FoldTest::error)
        return {"texture", true,
                "folds are tested against what they change of it, and its detail against how far they move it"};
    if (decision.test == FoldTest::luebke_hallen_safe)
        return {"texture", true,
                "folds are tested against its darkest and brightest texels around them, and by how far they move it"};
    return {"texture", true, "folds are tested against its darkest and brightest texels around them"};
}

Effect chroma_effect(const Sight& sight, const Decision& decision) {
    if (!is_perceptual(decision)) return {"chroma", false, "only the perceptual fold test knows it"};
    if (!decision.request.chroma)
        return {"chroma", false, Message::of("without {request.chroma} only luminance counts")};
    if (!perception::has_chroma(sight.object.tree)) return {"chroma", false, "nothing has any colour"};
    return {"chroma", true, "red-green and yellow-violet contrast count beside that of luminance, by castleCSF"};
}

Effect light_effect(const Sight& sight, const Decision& decision) {
    if (sight.lighting)
        return {"light", true,
                sight.lights->description() +
                    (is_perceptual(decision)
                         ? ": folds are tested against what these can make of the normals and places in their rings"
                         : "; drawn, for the fold test does not look at luminance")};
    if (sight.object.is_relit)
        return {"light", true, "luminance and its bounds were computed again for another light than the tree's"};
    return {"light", false,
            sight.object.tree.is_prelit() ? "the colours are pre-lit" : "the light that the tree was built for"};
}

Effect shadow_effect(const Sight& sight, const Decision& decision, const std::optional<CutFacts>& facts) {
    if (!casts_shadows(sight)) return {"shadows", false, "no light casts a shadow: no pass"};
    const std::size_t casting = vdtree::shadow_lights(*sight.lighting), all = sight.lighting->lights.size();
    std::string why =
        std::to_string(casting) + " of " + std::to_string(all) + (casting == 1 ? " lights casts" : " lights cast");
    if (is_full(decision)) return {"shadows", true, why};
    if (!is_perceptual(decision))
        return {"shadows", true,
                why + "; the fold test " + name_of(decision.test) +
                    " does not look at them, so their edges may move visibly"};
    if (!decision.request.keeps_shadows)
        return {"shadows", true, why + Message::of("; without {request.keeps_shadows} their edges may move visibly")};
    why += "; folds are tested with any of these hidden, and outlines that a light sees fold only where their shadows' "
           "edges move invisibly";
    if (decision.request.purpose == Purpose::picture) why += " or out of the window";
    if (facts && facts->outlines == 0) why += ": as all do here";
    else if (facts)
        why += ": " + grouped(facts->outlines) + " of " + grouped(sight.object.tree.interior_count()) +
               " nodes are kept for that";
    return {"shadows", true, why};
}

constexpr const char* but_shadows = ", but for outlines whose shadows would move visibly";

Effect frustum_effect(const Sight& sight, const Decision& decision) {
    if (is_full(decision)) return {"frustum culling", false, "nothing is folded in the full model"};
    if (decision.request.purpose == Purpose::mesh)
        return {"frustum culling", false, "the mesh may be looked at from elsewhere"};
    if (may_cast_anything(sight, decision)) return {"frustum culling", false, may_cast};
    return {"frustum culling", true,
            std::string("what lies outside of the window is folded") + (casts_shadows(sight) ? but_shadows : "")};
}

Effect culling_effect(const Sight& sight, Purpose purpose) {
    const WorldSphere sphere = world_sphere(sight.object);
    const bool is_open = sight.object.tree.closedness() == vdtree::Closedness::open;
    const bool is_outside = !is_around_eye(sphere, sight.view);
    if (purpose == Purpose::mesh) return {"back-face culling", false, "nothing is drawn"};
    if (is_open) return {"back-face culling", false, "the surface is open, so both sides are drawn"};
    if (!is_outside) return {"back-face culling", false, "the eye is in the model, so both sides are drawn"};
    return {"back-face culling", true,
            sight.object.tree.closedness() == vdtree::Closedness::closed_outward
                ? "the surface is closed, so its inner side cannot be seen"
                : "the surface is closed but inside out, so it is turned"};
}

Effect magnification_effect(const Sight& sight, const Decision& decision) {
    if (sight.view.orthographic_height)
        return {"magnification", false, "the view is orthographic: sizes are those on the screen, at any depth"};
    const double physical = perception::physical_field(sight.observer.display, sight.view.height).value();
    const std::string fields =
        rounded(sight.view.fov_y_degrees, 4) + " degrees, the window fills " + rounded(physical, 4);
    if (std::abs(sight.view.fov_y_degrees - physical) <= same_field_degrees)
        return {"magnification", false, "the camera's field is the one that the window fills on the display"};
    if (!is_perceptual(decision)) return {"magnification", false, "pixels do not depend on it (camera " + fields + ")"};
    return {"magnification", true, "the camera's field is " + fields + ": angles are those on the screen"};
}

Effect distance_effect(const Decision& decision, const std::optional<CutFacts>& facts) {
    const std::string name = "imperceptible distance";
    if (is_full(decision)) return {name, true, "nothing is folded, so it holds from any distance"};
    if (!is_perceptual(decision))
        return {name, false, "costs of the fold test " + name_of(decision.test) + " are no distances"};
    if (facts && std::isinf(facts->imperceptible_from_m))
        return {name, false, "a fold around the eye or across its plane stays visible from everywhere"};
    if (decision.request.goal.kind == Goal::Kind::imperceptible)
        return {name, true,
                "the display's distance times " + rounded(decision.request.threshold, 4) +
                    ", above which no fold costs"};
    return {name, true, "the display's distance times the largest fold cost"};
}

Effect back_face_effect(const Sight& sight, Purpose purpose) {
    if (purpose == Purpose::mesh) return {"back-face folding", false, "the mesh may be looked at from elsewhere"};
    if (culls_back_faces(sight))
        return {"back-face folding", true,
                casts_shadows(sight) ? "what faces away is folded, but for outlines whose shadows would move visibly"
                                     : "what faces away is not drawn, so it is folded"};
    if (sight.object.tree.closedness() == vdtree::Closedness::open)
        return {"back-face folding", false, "the surface is open"};
    if (is_translucent(sight)) return {"back-face folding", false, "what faces away may show through"};
    return {"back-face folding", false, "the eye is in the model"};
}

Effect hidden_effect(const Sight& sight, const Decision& decision, const std::optional<CutFacts>& facts) {
    const std::string name = "hidden folding";
    if (decision.request.purpose == Purpose::mesh) return {name, false, "the mesh may be looked at from elsewhere"};
    if (folds_unseen(sight, decision))
        return {name, true,
                std::string("what lies behind what this view shows is folded, by a picture of its depths") +
                    (casts_shadows(sight) ? but_shadows : "")};
    if (may_cast_anything(sight, decision)) return {name, false, may_cast};
    if (!folds_hidden(sight, decision))
        return {name, false,
                is_perceptual(decision) ? "nothing solid is looked at from outside"
                                        : "only the perceptual fold tests know what a fold changes"};
    if (!facts) return {name, true, "what is behind spheres inside the solid is folded"};
    if (facts->occluders == 0) return {name, false, "no sphere fits into the solid"};
    return {name, true,
            "what is behind one of " + std::to_string(facts->occluders) + " spheres inside the solid is folded" +
                (casts_shadows(sight) ? but_shadows : "")};
}

Effect masking_effect(const Sight& sight, const Decision& decision) {
    if (decision.masking)
        return {"masking", true,
                "folds are tested against thresholds that the scene around the object raises in this view, by " +
                    std::to_string(decision.masking->bands().size()) + " bands of frequency"};
    if (decision.request.masking.empty())
        return {"masking", false, Message::of("without {request.masking} nothing masks what folds change")};
    if (decision.test != FoldTest::error)
        return {"masking", false, "the fold test " + name_of(decision.test) + " does not know it"};
    return {"masking", false, why_unmasked(sight)};
}

Effect translucency_effect(const Sight& sight, const Decision& decision) {
    if (!is_perceptual(decision)) return {"translucency", false, "only the perceptual fold test knows it"};
    if (!is_translucent(sight)) return {"translucency", false, "no vertex has an alpha below 1"};
    return {"translucency", true, "where a vertex has an alpha below 1, anything in the scene may show through"};
}

Effect time_limit_effect(const Decision& decision, const std::optional<CutFacts>& facts) {
    if (!decision.request.milliseconds) return {"time limit", false, "none is given"};
    return {"time limit", true,
            !facts               ? "it ends the cut; the worst folds are undone first"
            : facts->is_complete ? "the cut was made within it"
                                 : "it ended the cut; the worst folds were undone first"};
}

} // namespace

std::vector<Effect> effects_of(const Sight& sight, const Decision& decision, const std::optional<CutFacts>& facts) {
    const Purpose purpose = decision.request.purpose;
    std::vector<Effect> effects = {fold_test_effect(sight, decision),     gaze_effect(sight, decision),
                                   silhouette_effect(sight, decision),    csf_effect(sight, decision),
                                   motion_effect(sight, decision),        reach_effect(sight, decision),
                                   chroma_effect(sight, decision),        translucency_effect(sight, decision),
                                   texture_effect(sight, decision),       prelit_effect(sight),
                                   light_effect(sight, decision),         shadow_effect(sight, decision, facts),
                                   frustum_effect(sight, decision),       culling_effect(sight, purpose),
                                   magnification_effect(sight, decision), distance_effect(decision, facts)};
    if (is_full(decision)) return effects;
    effects.push_back(back_face_effect(sight, purpose));
    effects.push_back(hidden_effect(sight, decision, facts));
    effects.push_back(masking_effect(sight, decision));
    effects.push_back(time_limit_effect(decision, facts));
    return effects;
}

Effect geomorph_effect(const vdtree::Geomorph* geomorph, const vdtree::Cut& cut) {
    if (!geomorph)
        return {"geomorphs", false,
                Message::of("vertices do not glide unless {Follower::set_glide()} says for how long")};
    return {"geomorphs", true,
            "vertices glide for " + rounded(geomorph->seconds(), 3) + " s; " + grouped(geomorph->moved().size()) +
                " do now, and " + grouped(geomorph->drawn().triangle_count() - cut.triangle_count()) +
                " triangles wait for them to be folded"};
}

} // namespace unseen::session
