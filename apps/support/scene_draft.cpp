#include "scene_draft.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <numbers>

#include <glm/geometric.hpp>
#include <nlohmann/json.hpp>

#include <unseen/vdtree/internal/atomic_file.h>

namespace unseen::app {
namespace {

using nlohmann::json;

double radians(double degrees) { return degrees * (std::numbers::pi / 180); }

json to_json(glm::dvec3 v) { return {v.x, v.y, v.z}; }
json to_json(glm::dquat q) { return {q.x, q.y, q.z, q.w}; }

// From -Z, where glTF's cameras and lights look.
glm::dquat looking(glm::dvec3 direction) {
    const glm::dvec3 back = -glm::normalize(direction);
    const glm::dvec3 up = std::abs(back.y) > 0.999 ? glm::dvec3(0, 0, 1) : glm::dvec3(0, 1, 0);
    const glm::dvec3 right = glm::normalize(glm::cross(up, back));
    return glm::quat_cast(glm::dmat3(right, glm::cross(back, right), back));
}

// The binary chunk, and what describes it.
class Data {
public:
    json views = json::array(), accessors = json::array();
    std::string bytes;

    template <class Value>
    std::size_t add(const std::vector<Value>& values, int component_type, const char* type, int target) {
        static_assert(std::endian::native == std::endian::little, "GLB files hold their numbers so");
        const std::size_t size = values.size() * sizeof(Value);
        views.push_back({{"buffer", 0}, {"byteOffset", bytes.size()}, {"byteLength", size}, {"target", target}});
        bytes.append(reinterpret_cast<const char*>(values.data()), size);
        bytes.resize((bytes.size() + 3) / 4 * 4, '\0');
        constexpr int unsigned_int = 5125;
        const std::size_t components = component_type == unsigned_int ? sizeof(Value) / 4 : 1;
        accessors.push_back({{"bufferView", views.size() - 1},
                             {"componentType", component_type},
                             {"count", values.size() * components},
                             {"type", type}});
        return accessors.size() - 1;
    }
};

json mesh_json(const SceneDraft::Mesh& draft, std::size_t material, Data& data) {
    constexpr int float_type = 5126, unsigned_int = 5125, array_buffer = 34962, element_array_buffer = 34963;
    std::vector<glm::vec3> positions;
    positions.reserve(draft.mesh.positions.size());
    glm::vec3 low(std::numeric_limits<float>::infinity()), high = -low;
    for (const glm::dvec3& p : draft.mesh.positions) {
        positions.emplace_back(p);
        low = glm::min(low, positions.back()), high = glm::max(high, positions.back());
    }
    json attributes = {{"POSITION", data.add(positions, float_type, "VEC3", array_buffer)}};
    data.accessors.back()["min"] = to_json(low);
    data.accessors.back()["max"] = to_json(high);
    if (!draft.mesh.normals.empty())
        attributes["NORMAL"] = data.add(draft.mesh.normals, float_type, "VEC3", array_buffer);
    return {{"name", draft.name},
            {"primitives",
             {{{"attributes", attributes},
               {"indices", data.add(draft.mesh.triangles, unsigned_int, "SCALAR", element_array_buffer)},
               {"material", material}}}}};
}

std::string word(std::size_t value) {
    std::string bytes;
    for (int i = 0; i < 4; ++i) bytes += static_cast<char>(value >> (8 * i) & 0xFF);
    return bytes;
}

} // namespace

std::size_t SceneDraft::add_mesh(std::string name, vdtree::Mesh mesh, double reflectance) {
    meshes_.push_back({std::move(name), std::move(mesh), reflectance});
    return meshes_.size() - 1;
}

void SceneDraft::add(std::size_t mesh, std::string name, const Place& place, bool is_background) {
    nodes_.push_back({mesh, std::move(name), place, is_background});
}

void SceneDraft::add_sun(glm::dvec3 towards, double lux, bool casts_shadow) {
    lights_.push_back({true, towards, lux, casts_shadow});
}
void SceneDraft::add_lamp(glm::dvec3 at, double candela, bool casts_shadow) {
    lights_.push_back({false, at, candela, casts_shadow});
}

void SceneDraft::set_camera(glm::dvec3 eye, glm::dvec3 target, double fov_y_degrees) {
    eye_ = eye, target_ = target, fov_y_degrees_ = fov_y_degrees;
}

void SceneDraft::set_light(double exposure, double ambient) { exposure_ = exposure, ambient_ = ambient; }

Result<void> SceneDraft::write(const std::filesystem::path& file) const {
    Data data;
    json document = {{"asset", {{"version", "2.0"}, {"generator", "Unseen"}}},
                     {"scene", 0},
                     {"extras", {{"unseen", {{"exposure", exposure_}, {"ambient", ambient_}}}}},
                     {"extensionsUsed", {"KHR_lights_punctual"}}};
    for (const Mesh& mesh : meshes_) {
        const double grey = mesh.reflectance;
        document["materials"].push_back(
            {{"name", mesh.name},
             {"pbrMetallicRoughness",
              {{"baseColorFactor", {grey, grey, grey, 1}}, {"metallicFactor", 0}, {"roughnessFactor", 1}}}});
        document["meshes"].push_back(mesh_json(mesh, document["meshes"].size(), data));
    }
    json& nodes = document["nodes"] = json::array();
    for (const Node& node : nodes_) {
        json out = {{"name", node.name}, {"mesh", node.mesh}};
        const Place& place = node.place;
        if (place.at != glm::dvec3(0)) out["translation"] = to_json(place.at);
        const glm::dquat turn = glm::angleAxis(radians(place.turn_degrees), glm::dvec3(0, 1, 0)) *
                                glm::angleAxis(radians(place.lean_degrees), glm::dvec3(0, 0, 1));
        if (place.turn_degrees != 0 || place.lean_degrees != 0) out["rotation"] = to_json(turn);
        if (place.scale != glm::dvec3(1)) out["scale"] = to_json(place.scale);
        if (node.is_background) out["extras"] = {{"unseen", {{"background", true}}}};
        nodes.push_back(std::move(out));
    }
    json& lights = document["extensions"]["KHR_lights_punctual"]["lights"] = json::array();
    for (const Light& light : lights_) {
        json node = {{"name", light.is_sun ? "sun" : "lamp"},
                     {"extensions", {{"KHR_lights_punctual", {{"light", lights.size()}}}}}};
        if (light.is_sun) node["rotation"] = to_json(looking(-light.place));
        else node["translation"] = to_json(light.place);
        lights.push_back({{"type", light.is_sun ? "directional" : "point"}, {"intensity", light.intensity}});
        if (light.casts_shadow) lights.back()["extras"] = {{"casts_shadow", true}};
        nodes.push_back(std::move(node));
    }
    document["cameras"] = {
        {{"type", "perspective"}, {"perspective", {{"yfov", radians(fov_y_degrees_)}, {"znear", 0.01}}}}};
    nodes.push_back({{"name", "camera"},
                     {"camera", 0},
                     {"translation", to_json(eye_)},
                     {"rotation", to_json(looking(target_ - eye_))}});
    json roots = json::array();
    for (std::size_t i = 0; i < nodes.size(); ++i) roots.push_back(i);
    document["scenes"] = {{{"nodes", std::move(roots)}}};
    document["bufferViews"] = std::move(data.views);
    document["accessors"] = std::move(data.accessors);
    document["buffers"] = {{{"byteLength", data.bytes.size()}}};

    std::string text = document.dump();
    text.resize((text.size() + 3) / 4 * 4, ' ');
    constexpr std::size_t headers = 12 + 8 + 8;
    const std::size_t total = headers + text.size() + data.bytes.size();
    if (total > std::numeric_limits<std::uint32_t>::max())
        return Error{ErrorCode::unsupported,
                     "Cannot write '" + file.string() +
                         "': it would exceed the 4 GiB of a GLB file; ask for fewer triangles."};
    auto out = vdtree::AtomicFile::create(file);
    if (!out) return out.error();
    const std::string before = "glTF" + word(2) + word(total) + word(text.size()) + "JSON" + text +
                               word(data.bytes.size()) + std::string("BIN\0", 4);
    if (auto ok = out->write(std::string_view(before)); !ok) return ok;
    if (auto ok = out->write(std::string_view(data.bytes)); !ok) return ok;
    return out->commit();
}

} // namespace unseen::app
