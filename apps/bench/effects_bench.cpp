#include "effects_bench.h"

#include <cmath>
#include <ctime>
#include <filesystem>
#include <functional>
#include <memory>

#include <glm/geometric.hpp>

#include <unseen/perception/criterion.h>
#include <unseen/session/model_file.h>
#include <unseen/session/session.h>

#include "bench_tools.h"
#include "model_file.h"
#include "terminal.h"

namespace unseen::app {
namespace {

using vdtree::DistanceCriterion;

struct Measured {
    vdtree::Index triangles = 0;
    double milliseconds = 0;
};

// What one variation of a test asks for.
struct Variation {
    std::string name, note;
    std::function<Result<DistanceCriterion>(const session::Session&, const perception::FoldTestOptions&)> criterion;
    bool has_gaze = true, culls = true, needs_errors = false, is_lit = false, hides = true;
};

Result<DistanceCriterion> plain(const session::Session& session, const perception::FoldTestOptions& options) {
    return perception::luebke_hallen_distances(session.tree(), session.default_view(), options);
}

// With other classes of contrast: `change` is given those of a node.
Result<DistanceCriterion> with_classes(const session::Session& session, const perception::FoldTestOptions& options,
                                       void (*change)(vdtree::FoldClass&)) {
    const auto made = plain(session, options);
    if (!made) return made.error();
    DistanceCriterion::Parts parts = made->parts();
    for (vdtree::FoldClass& classes : parts.classes) change(classes);
    return DistanceCriterion::create(session.tree(), std::move(parts));
}

std::vector<Variation> variations() {
    std::vector<Variation> all;
    all.push_back({"luebke-hallen, all effects",
                   "silhouettes, contrast, gaze 29 degrees aside, back faces and what the solid hides folded", plain});
    all.push_back({"no gaze", "what eccentricity saves", plain, false});
    all.push_back({"no back-face folding", "what faces away is kept like what faces the eye", plain, true, false});
    all.push_back({"no hidden folding", "what is behind spheres inside the solid is kept", plain, true, true, false,
                   false, false});
    all.push_back({"no contrast",
                   "every fold counts as one against anything in the scene. That is what knowing luminance saves",
                   [](const session::Session& session, const perception::FoldTestOptions& options) {
                       return with_classes(session, options, [](vdtree::FoldClass& c) { c.interior = c.silhouette; });
                   }});
    all.push_back({"no silhouettes",
                   "outlines count like what lies inside. That is not safe, and tells what keeping them costs",
                   [](const session::Session& session, const perception::FoldTestOptions& options) {
                       return with_classes(session, options, [](vdtree::FoldClass& c) { c.silhouette = c.interior; });
                   }});
    all.push_back({"chroma", "with contrast of colour. Where all is grey it makes no difference",
                   [](const session::Session& session, perception::FoldTestOptions options) {
                       options.chroma = true;
                       return plain(session, options);
                   }});
    all.push_back({"dynamic light",
                   "bounds over the normals in a ring in place of baked luminances. Light: ambient 0.2, and two "
                   "directional lights, 0.8 and 0.2",
                   nullptr, true, true, false, true});
    all.push_back({"luebke-hallen-safe", "rings of all cuts, and shifts of the mean",
                   [](const session::Session& session,
                      const perception::FoldTestOptions& options) -> Result<vdtree::DistanceCriterion> {
                       const auto rings = session.cut_rings();
                       if (!rings) return rings.error();
                       return perception::luebke_hallen_safe_distances(session.tree(), **rings, session.default_view(),
                                                                       options);
                   }});
    all.push_back({"error", "what folds change in fact, in place of what they could",
                   [](const session::Session& session, const perception::FoldTestOptions& options) {
                       return perception::error_distances(session.tree(), session.default_view(), options);
                   },
                   true, true, true});
    all.push_back({"error, no gaze", "the same, looked at",
                   [](const session::Session& session, const perception::FoldTestOptions& options) {
                       return perception::error_distances(session.tree(), session.default_view(), options);
                   },
                   false, true, true});
    return all;
}

// This thread's own time, whatever else the machine does.
double thread_seconds() {
    timespec now;
    return clock_gettime(CLOCK_THREAD_CPUTIME_ID, &now) == 0
               ? static_cast<double>(now.tv_sec) + 1e-9 * static_cast<double>(now.tv_nsec)
               : 0;
}

vdtree::Lighting default_lights() {
    vdtree::LightSource light;
    light.direction = glm::normalize(glm::dvec3(vdtree::Light().direction));
    light.intensity = 1 - static_cast<double>(vdtree::Light().ambient);
    vdtree::Lighting lighting;
    vdtree::LightSource opposite = light; // as weak as that of trees
    opposite.direction = -light.direction;
    opposite.intensity *= static_cast<double>(vdtree::Light().fill);
    lighting.lights = {light, opposite};
    lighting.ambient = static_cast<double>(vdtree::Light().ambient);
    return lighting;
}

Result<perception::FoldTestOptions> test_options(const session::Session& session, bool has_gaze) {
    const vdtree::View view = session.default_view();
    const auto luminance = session.luminance(view);
    if (!luminance) return luminance.error();
    perception::FoldTestOptions options;
    options.display = session.observer().display;
    options.scene = *luminance;
    if (has_gaze) options.gaze_px = session::gaze_aside(options.display, view, session::usual_degrees_aside);
    return options;
}

// Sets the lights of the viewpoint, too.
Result<DistanceCriterion> criterion_of(const Variation& variation, const session::Session& session,
                                       perception::FoldTestOptions options, vdtree::Viewpoint& viewpoint) {
    if (!variation.is_lit) return variation.criterion(session, options);
    const auto bounds = vdtree::LightBounds::measure(session.tree());
    if (!bounds) return bounds.error();
    viewpoint.lighting = default_lights();
    options.scene =
        perception::lit_scene(session.tree(), *bounds, viewpoint.lighting, viewpoint.eye, session.background());
    return perception::lit_distances(session.tree(), std::make_shared<const vdtree::LightBounds>(*bounds),
                                     session.default_view(), options);
}

Result<Measured> measure(const session::Session& session, const Variation& variation, int repeats) {
    const auto asked = test_options(session, variation.has_gaze);
    if (!asked) return asked.error();
    const perception::FoldTestOptions& options = *asked;
    vdtree::Viewpoint viewpoint = perception::viewpoint_of(session.tree(), session.default_view(), options);
    if (variation.hides)
        viewpoint.occluders.assign(session.inner_spheres().begin(),
                                   session.inner_spheres().end()); // of open surfaces, none
    const auto criterion = criterion_of(variation, session, options, viewpoint);
    if (!criterion) return criterion.error();
    vdtree::FollowOptions following;
    following.cull_back_faces = variation.culls && session.tree().closedness() != vdtree::Closedness::open;
    Measured measured;
    std::vector<double> milliseconds;
    for (int i = 0; i < repeats; ++i) {
        vdtree::Cut cut(session.tree());
        const double start = thread_seconds();
        const auto stats = cut.follow(*criterion, viewpoint, following);
        static_cast<void>(cut.indices());
        milliseconds.push_back((thread_seconds() - start) * 1e3);
        if (!stats) return stats.error();
        measured.triangles = cut.triangle_count();
    }
    measured.milliseconds = median(milliseconds);
    return measured;
}

Result<std::vector<std::pair<std::string, vdtree::VertexTree>>> load(const std::vector<std::string>& files) {
    std::vector<std::pair<std::string, vdtree::VertexTree>> trees;
    std::vector<std::string> wanted = files.empty() ? installed_meshes() : files;
    for (const std::string& file : wanted) {
        auto tree = load_tree(file);
        if (!tree) return tree.error();
        trees.emplace_back(std::filesystem::path(file).stem().string(), std::move(*tree));
    }
    if (!trees.empty()) return trees;
    auto tree = sample_tree();
    if (!tree) return tree.error();
    trees.emplace_back("sphere", std::move(*tree));
    return trees;
}

} // namespace

Result<EffectsBenchResult> bench_effects(const EffectsBenchOptions& options) {
    auto trees = load(options.meshes);
    if (!trees) return trees.error();
    const std::vector<Variation> all = variations();
    EffectsBenchResult result;
    result.table.rows.assign(all.size() + 2, {});
    result.table.rows[0].push_back("triangles kept; ms of a new cut");
    result.table.rows[1].push_back("of");
    for (std::size_t i = 0; i < all.size(); ++i) {
        result.table.rows[i + 2].push_back(all[i].name);
        result.table.notes.push_back(all[i].name + ": " + all[i].note + ".");
    }
    const Pinned pinned;
    for (auto& [name, tree] : *trees) {
        auto measured_tree = session::measured(tree, 1);
        if (!measured_tree) return measured_tree.error();
        const auto session = session::Session::create(session::Scene::of(std::move(tree)));
        const auto with_errors = session::Session::create(session::Scene::of(std::move(*measured_tree)));
        if (!session) return session.error();
        if (!with_errors) return with_errors.error();
        result.table.rows[0].push_back(name);
        result.table.rows[1].push_back(grouped(session->tree().triangle_count()));
        for (std::size_t i = 0; i < all.size(); ++i) {
            const auto found = measure(all[i].needs_errors ? *with_errors : *session, all[i], options.quick ? 3 : 11);
            if (!found) return found.error();
            result.table.rows[i + 2].push_back(grouped(found->triangles) + "; " + rounded(found->milliseconds, 3));
            result.effects.push_back({{"mesh", name},
                                      {"variation", all[i].name},
                                      {"triangles", found->triangles},
                                      {"milliseconds", found->milliseconds}});
        }
    }
    return result;
}

} // namespace unseen::app
