#include <unseen/session/scene.h>

#include <algorithm>
#include <cmath>

#include <unseen/vdtree/internal/errors.h>

#include "loaded_tree.h"
#include "textures.h"

#include <glm/geometric.hpp>

namespace unseen::session {
namespace {

// Scaled first, so that neither tiny nor huge directions under- or overflow when squared.
glm::vec3 unit_vector(glm::dvec3 v) {
    const double largest = std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)});
    return glm::vec3(glm::normalize(v / largest));
}

bool is_direction(glm::dvec3 v) {
    return std::isfinite(v.x) && std::isfinite(v.y) && std::isfinite(v.z) && v != glm::dvec3(0);
}

Result<void> check_light(std::optional<glm::dvec3> towards, std::optional<double> ambient, std::optional<double> fill) {
    if (towards && !is_direction(*towards))
        return invalid_argument("A light's direction must be finite and not 0 0 0.");
    if (ambient && !(*ambient >= 0 && *ambient <= 1))
        return invalid_argument("The share of light from everywhere must be from 0 to 1.");
    if (fill && !(*fill >= 0 && *fill <= 1))
        return invalid_argument("The share of light from the opposite side must be from 0 to 1.");
    return {};
}

} // namespace

Result<calibration::LightRig> light_rig(std::optional<glm::dvec3> towards, std::optional<double> ambient,
                                        std::optional<double> fill) {
    if (const auto valid = check_light(towards, ambient, fill); !valid) return valid.error();
    const vdtree::Light usual;
    const glm::dvec3 direction = glm::normalize(glm::dvec3(towards ? unit_vector(*towards) : usual.direction));
    vdtree::Lighting lighting;
    lighting.ambient = ambient.value_or(static_cast<double>(usual.ambient));
    const auto add = [&](double intensity, glm::dvec3 from) {
        if (!(intensity > 0)) return;
        lighting.lights.emplace_back().intensity = intensity;
        lighting.lights.back().direction = from;
    };
    add(1 - lighting.ambient, direction);
    add((1 - lighting.ambient) * fill.value_or(static_cast<double>(usual.fill)), -direction);
    return calibration::LightRig::of(std::move(lighting), "the usual light");
}

Result<Scene> Scene::load(const std::filesystem::path& file, const LoadOptions& options) {
    if (!(options.unit_metres > 0 && std::isfinite(options.unit_metres)))
        return invalid_field("{load.unit_metres} must be above 0 and finite.");
    if (options.as != LoadAs::model) {
        const bool may_be_scene = meshio::is_gltf_file(file);
        if (!may_be_scene && options.as == LoadAs::scene)
            return invalid_field("{} is no glTF file (.glb, .gltf), and only these are scenes: read it with "
                                 "{load.as = }model.",
                                 {file.string()});
        if (may_be_scene) {
            auto read = meshio::SceneFile::read(file, reading_options(options));
            if (!read) return read.error();
            if (options.as == LoadAs::scene || read->contents().is_scene)
                return scene_from(std::move(*read), file, options);
        }
    }
    auto loaded = session::load(file, options, true);
    if (!loaded) return loaded.error();
    Scene scene = of(std::move(loaded->tree), options.unit_metres);
    scene.objects[0].origin = loaded->origin;
    scene.objects[0].measurement = std::move(loaded->measurement);
    scene.objects[0].name = file.filename().string();
    scene.objects[0].texture_left_out = options.without_textures;
    return scene;
}

Scene Scene::of(vdtree::VertexTree tree, double unit_metres) {
    Scene scene;
    scene.objects.push_back({std::move(tree)});
    scene.objects[0].placement.scale = unit_metres;
    return scene;
}

Scene Scene::share() const {
    const auto shared = [](const std::vector<Object>& objects) {
        std::vector<Object> handles;
        for (const Object& of : objects)
            handles.push_back({of.tree.share(), of.placement, of.name, of.texture_left_out, of.is_relit, of.origin,
                               of.measurement, of.node, of.mesh});
        return handles;
    };
    return {shared(objects), background, lights, shared(backdrop), camera, source};
}

Result<void> Scene::relight(std::optional<glm::dvec3> towards, std::optional<double> ambient,
                            std::optional<double> fill) {
    if (!towards && !ambient && !fill) return {};
    if (const auto valid = check_light(towards, ambient, fill); !valid) return valid;
    for (Object& object : objects) {
        vdtree::Light light = object.tree.light();
        if (towards) light.direction = unit_vector(*towards);
        if (ambient) light.ambient = static_cast<float>(*ambient);
        if (fill) light.fill = static_cast<float>(*fill);
        if (light == object.tree.light() && !object.tree.is_prelit()) continue;
        auto relit = object.tree.relit(light);
        if (!relit) return relit.error();
        object.tree = std::move(*relit);
        object.measurement.reset(); // of the tree as it was read
        object.is_relit = true;
    }
    return {};
}

} // namespace unseen::session
