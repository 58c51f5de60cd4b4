// What takes part in making a cut and what does not, with reasons: a row for each.
#include "fold_test.h"

#include <algorithm>
#include <cmath>

#include <glm/geometric.hpp>

#include <unseen/perception/internal/motion.h>
#include <unseen/vdtree/internal/number_format.h>

namespace unseen::session {
namespace {

// The default field is the physical one, computed by way of degrees: rounding is no magnification.
constexpr double same_field_degrees = 1e-7;

// What reasons look at.
struct Cutting {
    const Sight& sight;
    const Decision& decision;
    const std::optional<CutFacts>& facts;

    bool is_full() const { return decision.request.goal.kind == Goal::Kind::full; }
    bool is_perceptual() const { return session::is_perceptual(decision); }
    bool is_for_mesh() const { return decision.request.purpose == Purpose::mesh; }
    std::string test() const { return name_of(decision.test); }
    // What else is folded stays where shadows would show it.
    std::string but_shadows(const std::string& folded) const {
        return folded + (casts_shadows(sight) ? ", but for outlines whose shadows would move visibly" : "");
    }
};

struct Reason {
    bool on;
    Message why;
};

// An effect that needs something says `otherwise` without it.
enum class Needs { nothing, folds, perception, picture, pictures };
struct EffectRow {
    const char* name;
    Needs needs;
    const char* otherwise;
    Reason (*reason)(const Cutting& c);
};

constexpr const char* folds_nothing = "nothing is folded in the full model";
constexpr const char* only_perceptual_knows = "only the perceptual fold test knows it";
constexpr const char* only_perceptual_looks_up = "only the perceptual fold test looks sensitivity up";
constexpr const char* from_elsewhere = "the mesh may be looked at from elsewhere";

Reason gaze(const Cutting& c) {
    if (!c.is_perceptual()) return {false, "the fold test " + c.test() + " does not use it"};
    const std::optional<Gaze>& gaze = c.sight.observer.gaze;
    if (!gaze) return {false, "no gaze is given, so everything counts as looked at"};
    const std::string around =
        gaze->margin_deg > 0 ? ", give or take " + rounded(gaze->margin_deg, 3) + " degrees," : std::string(",");
    // Without commas in thousands, for a comma parts the coordinates of a pixel.
    const auto to_tenths = [](double px) { return shortest(std::round(10 * px) / 10); };
    return {true, "the viewer looks at pixel " + to_tenths(gaze->px.x) + ", " + to_tenths(gaze->px.y) + around +
                      " and sees less sharply elsewhere"};
}

Reason silhouettes(const Cutting& c) {
    const auto cdm2 = [&](float relative) {
        return rounded(perception::to_luminance(c.sight.observer.display, static_cast<double>(relative)).value(), 3);
    };
    return {true, "folds on outlines are tested against " + cdm2(c.sight.luminance.darkest) + " to " +
                      cdm2(c.sight.luminance.brightest) + " cd/m2, the whole scene with its background"};
}

Reason motion(const Cutting& c) {
    if (c.sight.observer.velocity <= perception::least_velocity)
        return {false, Message::of("without {observer.velocity} everything counts as still on the retina")};
    return {true, "everything counts as moving over the retina at " + rounded(c.sight.observer.velocity.value(), 3) +
                      " degrees/s, where fine things blur and coarse ones are seen better; what stands still, or what "
                      "the eye follows, is seen more finely than that"};
}

// Where in the window, and between which luminances, the table has no samples.
Reason beyond_table(const Cutting& c) {
    const Sight& sight = c.sight;
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
    if (beyond.empty()) return {false, "the table reaches as far as the window and its light do"};
    return {true, beyond};
}

Reason chroma(const Cutting& c) {
    std::optional<bool>& has_colours = c.sight.cache.has_colours;
    if (!has_colours) has_colours = perception::has_colours(c.sight.object.tree);
    if (!*has_colours) return {false, "nothing has any colour"};
    if (c.sight.lighting)
        return {false, Message::of("under {scene.lights} what folds change is known of luminance alone")};
    if (c.decision.test == FoldTest::error)
        return {true, "what folds change of red-green and yellow-violet counts beside luminance"};
    if (!c.sight.object.tree.texture().empty()) return {false, "the fold test looks at luminance alone in textures"};
    return {true, "red-green and yellow-violet contrast count beside that of luminance, by castleCSF"};
}

Reason translucency(const Cutting& c) {
    if (!is_translucent(c.sight)) return {false, "no vertex has an alpha below 1, and all texels are there"};
    return {true, "where a vertex has an alpha below 1 or texels are cut out, anything in the scene may show through"};
}

Reason texture(const Cutting& c) {
    const vdtree::TextureView texture = c.sight.object.tree.texture();
    if (texture.empty())
        return {false, c.sight.object.texture_left_out ? Message::of("{load.without_textures} leaves it out")
                                                       : Message("the model has none")};
    const bool has_relief = !texture.relief.empty(), shines = !texture.emission.empty();
    const std::string maps = has_relief && shines ? "its normal map and its emission"
                             : has_relief         ? "its normal map"
                             : shines             ? "its emission"
                                                  : "";
    if (!c.is_perceptual()) return {true, "drawn; folds are not tested against it"};
    if (c.decision.test == FoldTest::error)
        return {true, "folds are tested against what they change of it" + (maps.empty() ? "" : " with " + maps) +
                          ", and its detail against how far they move it"};
    const std::string extremes = "folds are tested against its darkest and brightest texels around them";
    return {true, extremes + (c.decision.test == FoldTest::luebke_hallen_safe ? ", and by how far they move it" : "") +
                      (maps.empty() ? "" : "; the fold test does not know " + maps)};
}

Reason prelit(const Cutting& c) {
    const vdtree::VertexTree& tree = c.sight.object.tree;
    if (c.sight.lighting && !tree.colours().empty()) return {false, Message::of("{scene.lights} lights the colours")};
    if (tree.is_prelit())
        return {true, tree.colours().empty() ? "the texture is taken as lit" : "the mesh's colours are taken as lit"};
    if (tree.colours().empty() && tree.texture().empty()) return {false, "the mesh has no colours"};
    return {false, "colours are reflectance, and are lit"};
}

Reason light(const Cutting& c) {
    if (c.sight.lighting)
        return {true,
                c.sight.lights->description() +
                    (c.is_perceptual()
                         ? ": folds are tested against what these can make of the normals and places in their rings"
                         : "; drawn, for the fold test does not look at luminance")};
    if (c.sight.object.is_relit)
        return {true, "luminance and its bounds were computed again for another light than the tree's"};
    return {false,
            c.sight.object.tree.is_prelit() ? "the colours are pre-lit" : "the light that the tree was built for"};
}

Reason shadows(const Cutting& c) {
    if (!casts_shadows(c.sight)) return {false, "no light casts a shadow: no pass"};
    const std::size_t casting = vdtree::shadow_lights(*c.sight.lighting), all = c.sight.lighting->lights.size();
    std::string why =
        std::to_string(casting) + " of " + std::to_string(all) + (casting == 1 ? " lights casts" : " lights cast");
    if (c.is_full()) return {true, why};
    if (!c.is_perceptual())
        return {true, why + "; the fold test " + c.test() + " does not look at them, so their edges may move visibly"};
    if (!c.decision.request.keeps_shadows)
        return {true, why + Message::of("; without {request.keeps_shadows} their edges may move visibly")};
    why += "; folds are tested with any of these hidden, and outlines that a light sees fold only where their shadows' "
           "edges move invisibly";
    if (!c.is_for_mesh()) why += " or out of the window";
    if (c.facts && c.facts->outlines == 0) why += ": as all do here";
    else if (c.facts)
        why += ": " + grouped(c.facts->outlines) + " of " + grouped(c.sight.object.tree.interior_count()) +
               " nodes are kept for that";
    return {true, why};
}

Reason frustum(const Cutting& c) {
    if (c.is_for_mesh()) return {false, from_elsewhere};
    if (may_cast_anything(c.sight, c.decision)) return {false, may_cast};
    return {true, c.but_shadows("what lies outside of the window is folded")};
}

Reason back_face_culling(const Cutting& c) {
    const vdtree::Closedness closedness = c.sight.object.tree.closedness();
    if (closedness == vdtree::Closedness::open) return {false, "the surface is open, so both sides are drawn"};
    if (is_around_eye(world_sphere(c.sight.object), c.sight.view))
        return {false, "the eye is in the model, so both sides are drawn"};
    return {true, closedness == vdtree::Closedness::closed_outward
                      ? "the surface is closed, so its inner side cannot be seen"
                      : "the surface is closed but inside out, so it is turned"};
}

Reason magnification(const Cutting& c) {
    const vdtree::View& view = c.sight.view;
    if (view.orthographic_height)
        return {false, "the view is orthographic: sizes are those on the screen, at any depth"};
    const double physical = perception::physical_field(c.sight.observer.display, view.height).value();
    const std::string fields = rounded(view.fov_y_degrees, 4) + " degrees, the window fills " + rounded(physical, 4);
    if (std::abs(view.fov_y_degrees - physical) <= same_field_degrees)
        return {false, "the camera's field is the one that the window fills on the display"};
    if (!c.is_perceptual()) return {false, "pixels do not depend on it (camera " + fields + ")"};
    return {true, "the camera's field is " + fields + ": angles are those on the screen"};
}

Reason imperceptible_distance(const Cutting& c) {
    if (c.is_full()) return {true, "nothing is folded, so it holds from any distance"};
    if (!c.is_perceptual()) return {false, "costs of the fold test " + c.test() + " are no distances"};
    if (c.facts && std::isinf(c.facts->imperceptible_from_m))
        return {false, "a fold around the eye or across its plane stays visible from everywhere"};
    if (c.decision.request.goal.kind != Goal::Kind::quality)
        return {true, "the display's distance times the largest fold cost"};
    return {true,
            "the display's distance times " + rounded(c.decision.request.goal.cost, 4) + ", above which no fold costs"};
}

constexpr const char* too_long = "from view to view it takes longer than drawing what it folds";

Reason back_face_folding(const Cutting& c) {
    if (folds_back_faces(c.sight, c.decision))
        return {true, casts_shadows(c.sight) ? c.but_shadows("what faces away is folded")
                                             : "what faces away is not drawn, so it is folded"};
    if (c.sight.object.tree.closedness() == vdtree::Closedness::open) return {false, "the surface is open"};
    if (may_fold_back_faces(c.sight)) return {false, too_long};
    return {false, is_translucent(c.sight) ? "what faces away may show through" : "the eye is in the model"};
}

Reason hidden_folding(const Cutting& c) {
    if (folds_unseen(c.sight, c.decision))
        return {true, c.but_shadows("what lies behind what the view shows is folded, by pictures of its depths")};
    if (c.is_for_mesh()) return {false, from_elsewhere};
    if (may_cast_anything(c.sight, c.decision)) return {false, may_cast};
    if (!folds_hidden(c.sight, c.decision) && c.is_perceptual() && may_fold_back_faces(c.sight))
        return {false, too_long};
    if (!folds_hidden(c.sight, c.decision))
        return {false, c.is_perceptual() ? "nothing solid is looked at from outside"
                                         : "only the perceptual fold tests know what a fold changes"};
    if (!c.facts) return {true, "what is behind spheres inside the solid is folded"};
    if (c.facts->occluders == 0) return {false, "no sphere fits into the solid"};
    return {true, c.but_shadows("what is behind one of " + std::to_string(c.facts->occluders) +
                                " spheres inside the solid is folded")};
}

Reason summed(const Cutting& c) {
    if (const char* why = why_not_summed(c.sight, c.decision)) return {false, why};
    return {true,
            std::string("what folds change in ") +
                (c.is_for_mesh() ? std::to_string(c.decision.request.shown.size()) + " pictures" : "the picture") +
                " adds up to the least, as far as nothing sticks out"};
}

Reason time_limit(const Cutting& c) {
    if (!c.decision.request.milliseconds) return {false, "none is given"};
    return {true, !c.facts               ? "it ends the cut; the worst folds are undone first"
                  : c.facts->is_complete ? "the cut was made within it"
                                         : "it ended the cut; the worst folds were undone first"};
}

constexpr EffectRow effect_rows[] = {
    {"fold test", Needs::folds, folds_nothing,
     [](const Cutting& c) -> Reason {
         return {true, c.test() + ": " + what_it_looks_at(c.sight, c.decision.test) +
                           (c.decision.why.empty() ? "" : " (" + std::string(c.decision.why) + ")")};
     }},
    {"gaze", Needs::folds, folds_nothing, gaze},
    {"silhouettes", Needs::perception, "only the perceptual fold test knows them", silhouettes},
    {"csf table", Needs::perception, only_perceptual_looks_up,
     [](const Cutting& c) -> Reason {
         return {c.sight.observer.csf != nullptr, describe(c.sight.observer)};
     }},
    {"motion", Needs::perception, only_perceptual_knows, motion},
    {"beyond the csf table", Needs::perception, only_perceptual_looks_up, beyond_table},
    {"colour", Needs::perception, only_perceptual_knows, chroma},
    {"translucency", Needs::perception, only_perceptual_knows, translucency},
    {"texture", Needs::nothing, "", texture},
    {"pre-lit colours", Needs::nothing, "", prelit},
    {"light", Needs::nothing, "", light},
    {"shadows", Needs::nothing, "", shadows},
    {"frustum culling", Needs::folds, folds_nothing, frustum},
    {"back-face culling", Needs::picture, "nothing is drawn", back_face_culling},
    {"magnification", Needs::nothing, "", magnification},
    {"imperceptible distance", Needs::nothing, "", imperceptible_distance},
};
// The full model has none of these.
constexpr EffectRow rows_of_folds[] = {
    {"back-face folding", Needs::picture, from_elsewhere, back_face_folding},
    {"hidden folding", Needs::pictures, from_elsewhere, hidden_folding},
    {"sum of errors", Needs::pictures, "what adds up is seen in a picture alone", summed},
    {"time limit", Needs::nothing, "", time_limit},
};

} // namespace

std::vector<Effect> effects_of(const Sight& sight, const Decision& decision, const std::optional<CutFacts>& facts) {
    const Cutting c{sight, decision, facts};
    std::vector<Effect> effects;
    const auto add = [&](const EffectRow& row) {
        const bool has_it = row.needs == Needs::folds        ? !c.is_full()
                            : row.needs == Needs::perception ? c.is_perceptual()
                            : row.needs == Needs::picture    ? !c.is_for_mesh()
                            : row.needs == Needs::pictures   ? !c.is_for_mesh() || !c.decision.request.shown.empty()
                                                             : true;
        Reason reason = has_it ? row.reason(c) : Reason{false, row.otherwise};
        effects.push_back({.name = row.name, .on = reason.on, .why = std::move(reason.why), .object = sight.number});
    };
    std::ranges::for_each(effect_rows, add);
    if (!c.is_full()) std::ranges::for_each(rows_of_folds, add);
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
