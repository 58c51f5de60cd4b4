#include "loaded_tree.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <map>
#include <mutex>
#include <thread>

#include <glm/geometric.hpp>
#include <glm/gtc/quaternion.hpp>
#include <glm/matrix.hpp>

#include <unseen/perception/fold_measurement.h>
#include <unseen/vdtree/builder.h>
#include <unseen/vdtree/internal/budget.h>
#include <unseen/vdtree/internal/errors.h>
#include <unseen/vdtree/internal/names.h>
#include <unseen/vdtree/internal/number_format.h>
#include <unseen/vdtree/internal/stopwatch.h>

#include "textures.h"

namespace unseen::session {
namespace {

namespace fs = std::filesystem;

// What glTF says nothing of: light that comes from everywhere, so that nothing is black.
constexpr double usual_ambient = 0.15; // relative luminance of white

// A mesh with a stretch: what one tree is of.
struct Part {
    std::size_t mesh = 0;
    glm::dmat3 stretch = glm::dmat3(1);
    bool folds = false;                          // shown by other nodes than those of the background, too
    std::optional<vdtree::VertexTree> tree = {}; // none: it has no triangles
    TreeOrigin origin = TreeOrigin::built;
    std::shared_ptr<const MeasurementPlace> measurement = {};
};

struct Placed {
    const meshio::SceneNode* node;
    vdtree::Similarity placement;
    std::size_t part;
};

Error in_file(const fs::path& file, const Error& error) {
    return Error{error.code, file.string() + ": " + error.message};
}

// Builds the trees of all parts: several at a time, for small ones leave cores idle.
class Builder {
public:
    Builder(meshio::SceneFile& file, const fs::path& name, const LoadOptions& options, bool is_lit)
        : file_(file), name_(name), options_(options), is_lit_(is_lit), cache_(options.cache) {}

    Result<void> build(std::vector<Part>& parts) {
        const auto start = vdtree::Clock::now();
        std::atomic<std::size_t> next{0}, done{0};
        const auto work = [&](bool is_caller) {
            for (std::size_t i; !is_over_ && (i = next++) < parts.size(); ++done) {
                if (const auto built = build(parts[i]); !built) fail(built.error());
                if (is_caller && options_.messages.progress &&
                    !options_.messages.progress(static_cast<double>(done) / static_cast<double>(parts.size()),
                                                "building trees"))
                    fail({ErrorCode::cancelled, name_.string() + ": building was cancelled."});
            }
        };
        const std::size_t workers = std::min<std::size_t>(std::max(1U, std::thread::hardware_concurrency()),
                                                          std::max<std::size_t>(parts.size(), 1));
        {
            std::vector<std::jthread> helpers;
            for (std::size_t i = 1; i < workers; ++i) helpers.emplace_back([&] { work(false); });
            work(true);
        }
        if (failure_) return *failure_;
        if (const auto known = check_protected(materials_, options_.protect); !known)
            return in_file(name_, known.error());
        tell(vdtree::seconds_since(start));
        return {};
    }

private:
    Result<void> build(Part& part) {
        auto read = read_part(part);
        if (!read) return read.error();
        if (!*read) return {};
        const bool is_measured = !is_lit_ && part.folds;
        vdtree::BuildOptions building;
        building.dropped_before = (*read)->dropped_triangles;
        building.prelit = options_.prelit || (*read)->is_unlit;
        building.crease = options_.crease;
        building.border_weight = border_weight(options_.protect);
        const std::string key = mesh_cache_key((*read)->mesh, building, is_measured && options_.measures,
                                               is_measured && options_.conserves_light);
        if (cache_.is_on()) {
            auto kept = cache_.find(key);
            if (!kept) return kept.error();
            if (*kept) {
                part.tree = std::move(**kept);
                part.origin = TreeOrigin::cache;
                part.measurement = place_of_mesh(cache_, key, name_, *part.tree);
                return {};
            }
        }
        auto tree = vdtree::build_tree((*read)->mesh.view(), building);
        if (!tree) return in_file(name_, tree.error());
        if (is_measured) tree = measured_as_asked(std::move(*tree), options_, {});
        if (!tree) return in_file(name_, tree.error());
        const std::lock_guard lock(mutex_);
        ++built_;
        if (cache_.is_on()) {
            const auto kept = cache_.keep(key, name_, *tree);
            if (!kept && not_kept_.empty()) not_kept_ = kept.error().message;
        }
        part.tree = std::move(*tree);
        part.measurement = place_of_mesh(cache_, key, name_, *part.tree);
        return {};
    }

    Result<std::optional<meshio::ReadResult>> read_part(const Part& part) {
        const std::lock_guard lock(mutex_);
        auto read = file_.mesh(part.mesh, part.stretch);
        if (!read) return read;
        if (!*read) {
            ++empty_;
            return read;
        }
        if (const auto laid = lay_texture(name_, **read, options_); !laid) return laid.error();
        if (const auto found = find_weights(**read, options_.protect); !found) return in_file(name_, found.error());
        for (const vdtree::MeshRange& range : (*read)->mesh.ranges)
            if (range.kind == vdtree::MeshRange::Kind::material) materials_.insert(range.name);
        for (std::string& warning : (*read)->warnings) warnings_.push_back(std::move(warning));
        for (std::string& note : (*read)->notes) notes_.push_back(std::move(note));
        return read;
    }

    void fail(const Error& error) {
        const std::lock_guard lock(mutex_);
        if (!failure_) failure_ = error;
        is_over_ = true;
    }

    // Sentences that several meshes have in common are said once.
    static void tell_each(std::vector<Message> texts, const fs::path& file,
                          const Callback<void(const std::string&)>& tell) {
        if (!tell) return;
        std::map<std::string, int> counts;
        for (const std::string& text : texts) ++counts[text];
        for (const auto& [text, count] : counts)
            tell(file.string() + ": " + (count > 1 ? "of " + std::to_string(count) + " meshes: " : "") + text);
    }

    void tell(double seconds) {
        if (empty_ > 0)
            warnings_.push_back(std::to_string(empty_) + (empty_ == 1 ? " mesh has" : " meshes have") +
                                " no triangles and is not drawn.");
        tell_each(std::move(warnings_), name_, options_.messages.warning);
        if (const auto sound = cache_.check(); !sound && options_.messages.warning)
            options_.messages.warning(sound.error().message);
        tell_each(std::move(notes_), name_, options_.messages.note);
        if (built_ == 0 || !options_.messages.note) return;
        const Message becomes = !not_kept_.empty() ? Message("not kept for the next time: " + not_kept_)
                                : cache_.is_on()   ? kept_in(cache_)
                                                   : Message("not kept for the next time");
        options_.messages.note("built " + std::to_string(built_) + (built_ == 1 ? " tree" : " trees") + " of " +
                               name_.string() + " in " + rounded(seconds, 2) + " s; " + becomes);
    }

    meshio::SceneFile& file_;
    const fs::path& name_;
    const LoadOptions& options_;
    bool is_lit_;
    TreeCache cache_;
    std::mutex mutex_;
    std::atomic<bool> is_over_{false};
    std::optional<Error> failure_;
    std::vector<Message> warnings_, notes_;
    std::set<std::string> materials_;
    std::string not_kept_;
    std::size_t built_ = 0, empty_ = 0;
};

// ---- affine transforms as a similarity after a stretch

// placement.to_world(stretch * x) is the transform of x. The stretch is symmetric, of determinant 1 or, for mirror
// images, -1; the identity where the transform is a similarity.
struct Factored {
    vdtree::Similarity placement;
    glm::dmat3 stretch = glm::dmat3(1);
};

// Two stretches that differ by no more, in any component, count as one. Single floats of nested nodes are off by some
// 1e-6; an object as large as the largest screen, 32768 pixels, moves by a third of a pixel.
constexpr double same_stretch = 1e-5;
// Beyond, what is thinnest is lost in the rounding of what is thickest.
constexpr double most_condition = 1e6;
constexpr int most_steps = 60; // of Newton's iteration, which doubles the digits: a few are enough

double largest_of(const glm::dmat3& m) {
    double largest = 0;
    for (int c = 0; c < 3; ++c)
        for (int r = 0; r < 3; ++r) largest = std::max(largest, std::abs(m[c][r]));
    return largest;
}

double norm(const glm::dmat3& m) {
    double sum = 0;
    for (int c = 0; c < 3; ++c) sum += glm::dot(m[c], m[c]);
    return std::sqrt(sum);
}

bool is_same_stretch(const glm::dmat3& a, const glm::dmat3& b) { return largest_of(a - b) <= same_stretch; }

// By polar decomposition. Nothing for a matrix that is not finite, or has no inverse.
std::optional<Factored> factor(const glm::dmat4& transform) {
    for (int c = 0; c < 4; ++c)
        for (int r = 0; r < 4; ++r)
            if (!std::isfinite(transform[c][r])) return std::nullopt;
    glm::dmat3 linear(transform);
    const double size = largest_of(linear);
    if (!(size > 0)) return std::nullopt;
    linear /= size; // a determinant of tiny scales would underflow
    const double determinant = glm::determinant(linear);
    const glm::dmat3 inverse = glm::inverse(linear);
    if (!(norm(linear) * norm(inverse) <= most_condition)) return std::nullopt; // NaN, too

    // Higham 1986: X becomes the mean of itself and its inverse transposed, both scaled to each other's size.
    glm::dmat3 turn = linear;
    for (int i = 0; i < most_steps; ++i) {
        const glm::dmat3 opposite = glm::transpose(glm::inverse(turn));
        const double scale = std::sqrt(norm(opposite) / norm(turn));
        const glm::dmat3 next = (turn * scale + opposite / scale) * 0.5;
        const double step = largest_of(next - turn);
        turn = next;
        constexpr double settled = 1e-15;
        if (step <= settled) break;
    }
    glm::dmat3 stretch = glm::transpose(turn) * linear;
    stretch = (stretch + glm::transpose(stretch)) * 0.5;
    const double scale = std::cbrt(std::abs(determinant));
    stretch /= scale;
    if (determinant < 0) turn = -turn, stretch = -stretch;

    Factored factored;
    factored.placement.scale = scale * size;
    factored.placement.rotation = glm::normalize(glm::quat_cast(turn));
    factored.placement.translation = glm::dvec3(transform[3]);
    if (!(factored.placement.scale > 0) || !std::isfinite(factored.placement.scale)) return std::nullopt;
    if (!is_same_stretch(stretch, glm::dmat3(1))) factored.stretch = stretch;
    return factored;
}

// ---- lights

struct Middle {
    glm::dvec3 centre = glm::dvec3(0);
    double radius = 1;
};

Middle middle_of(const std::vector<Object>& objects) {
    glm::dvec3 low(std::numeric_limits<double>::infinity()), high = -low;
    for (const Object& object : objects) {
        const vdtree::Sphere sphere = object.tree.bounding_sphere();
        const glm::dvec3 centre = object.placement.to_world(object.tree.origin() + glm::dvec3(sphere.centre));
        const double radius = object.placement.scale * static_cast<double>(sphere.radius);
        low = glm::min(low, centre - radius), high = glm::max(high, centre + radius);
    }
    if (objects.empty()) return {};
    return {(low + high) * 0.5, std::max(glm::length(high - low) * 0.5, 1e-30)};
}

// Lux on what faces the light in the middle, or at half of the radius from lights that are nearer.
double strength(const meshio::SceneLight& light, const Middle& middle, double unit_metres) {
    if (light.kind == meshio::SceneLight::Kind::directional) return light.intensity;
    const double distance = std::max(glm::length(light.position * unit_metres - middle.centre), middle.radius * 0.5);
    return light.intensity / (distance * distance);
}

vdtree::LightSource source_of(const meshio::SceneLight& light, double exposure, double unit_metres) {
    using Kind = vdtree::LightSource::Kind;
    vdtree::LightSource source;
    source.intensity = light.intensity * exposure; // of candelas: at a metre
    source.casts_shadow = light.casts_shadow;
    if (light.kind == meshio::SceneLight::Kind::directional) {
        source.direction = -light.direction;
        return source;
    }
    source.kind = light.kind == meshio::SceneLight::Kind::point ? Kind::point : Kind::spot;
    source.position = light.position * unit_metres;
    if (source.kind == Kind::point) return source;
    // Sharper edges of spots than this are none that a vertex shows, and their bounds none.
    constexpr double least_edge = 0.5 * 3.14159265358979323846 / 180;
    const double outer = std::max(light.outer_radians, 2 * least_edge);
    source.direction = light.direction;
    source.outer_cosine = std::cos(outer);
    source.inner_cosine = std::cos(std::min(light.inner_radians, outer - least_edge));
    return source;
}

Result<calibration::LightRig> lights_of(const meshio::SceneContents& contents, const Middle& middle,
                                        const fs::path& file, const LoadOptions& options) {
    std::vector<meshio::SceneLight> lights = contents.lights;
    const auto stronger = [&](const meshio::SceneLight& a, const meshio::SceneLight& b) {
        return strength(a, middle, options.unit_metres) > strength(b, middle, options.unit_metres);
    };
    if (lights.size() > vdtree::most_lights) {
        if (options.messages.warning)
            options.messages.warning(file.string() + ": of its " + std::to_string(lights.size()) + " lights the " +
                                     std::to_string(vdtree::most_lights) +
                                     " that are strongest in its middle light it.");
        std::stable_sort(lights.begin(), lights.end(), stronger);
        lights.resize(vdtree::most_lights);
    }
    double sum = 0;
    for (const meshio::SceneLight& light : lights) sum += strength(light, middle, options.unit_metres);
    vdtree::Lighting lighting;
    lighting.ambient = contents.ambient.value_or(usual_ambient);
    const double exposure = contents.exposure.value_or(sum > 0 ? (1 - std::min(lighting.ambient, 0.9)) / sum : 1);
    for (const meshio::SceneLight& light : lights)
        lighting.lights.push_back(source_of(light, exposure, options.unit_metres));
    return calibration::LightRig::of(std::move(lighting), file);
}

bool is_in_reach(const vdtree::Similarity& placement) {
    constexpr double least = 1e-15, most = 1e15;
    return placement.scale >= least && placement.scale <= most && glm::length(placement.translation) <= most;
}

bool is_turned(const vdtree::Similarity& placement) {
    constexpr double same_direction = 1e-6; // of a unit quaternion's vector: less than any light shows
    const glm::dquat& q = placement.rotation;
    return glm::length(glm::dvec3(q.x, q.y, q.z)) > same_direction;
}

// What the nodes of a file show, and where.
struct Layout {
    std::vector<Part> parts = {};
    std::vector<Placed> placed = {};
    bool turns = false; // an object
};

Result<Layout> lay_out(const meshio::SceneContents& contents, const fs::path& name, const LoadOptions& options) {
    Layout layout;
    std::map<std::size_t, std::vector<std::size_t>> of_mesh; // parts
    for (const meshio::SceneNode& node : contents.nodes) {
        const auto wrong = [&](std::string_view text) {
            return Error{ErrorCode::malformed_data,
                         Message::of(text, {name.string(), std::to_string(node.node), in_quotes(node.name)})};
        };
        auto factored = factor(node.to_world);
        if (!factored)
            return wrong(
                "{}: node {} {} has, with the nodes above it, a transform without an inverse (a scale of 0, or "
                "one that is a million times another): correct it, or read the file with {load.as = }model.");
        factored->placement.scale *= options.unit_metres;
        factored->placement.translation *= options.unit_metres;
        if (!is_in_reach(factored->placement))
            return wrong(
                "{}: node {} {} is too small, too large or too far away for single floats (beyond 1e-15 to 1e15 "
                "metres): correct its transform, or give {load.unit_metres}.");
        layout.turns = layout.turns || is_turned(factored->placement);
        const auto mesh = static_cast<std::size_t>(node.mesh);
        std::vector<std::size_t>& same = of_mesh[mesh];
        auto found = std::ranges::find_if(
            same, [&](std::size_t part) { return is_same_stretch(layout.parts[part].stretch, factored->stretch); });
        if (found == same.end()) {
            found = same.insert(same.end(), layout.parts.size());
            layout.parts.push_back({mesh, factored->stretch});
        }
        Part& part = layout.parts[*found];
        part.folds = part.folds || !node.is_background;
        layout.placed.push_back({&node, factored->placement, *found});
    }
    return layout;
}

} // namespace

Result<Scene> scene_from(meshio::SceneFile file, const fs::path& name, const LoadOptions& options) {
    const meshio::SceneContents& contents = file.contents();
    if (!options.texture.empty() && !names_folder(options))
        return invalid_field(
            "{} is a scene, and {load.texture} lies over one model: leave it out, or read the file with "
            "{load.as = }model.",
            {name.string()});
    auto layout = lay_out(contents, name, options);
    if (!layout) return layout.error();
    tell(options.messages.warning, name, contents.warnings);
    tell(options.messages.note, name, contents.notes);

    for (const Protection& protection : options.protect)
        if (protection.kind == Protection::Kind::vertices)
            return in_file(name, invalid_field("{load.protect}: {} is for one mesh, and this is a scene of several: "
                                               "add {load.as = }model.",
                                               {protection.name}));
    // The test by errors knows the trees' own light alone.
    const bool is_lit = !options.prelit && (!contents.lights.empty() || layout->turns);
    if (const auto built = Builder(file, name, options, is_lit).build(layout->parts); !built) return built.error();
    Scene scene;
    // What an object takes in a session, with its cut, and what it adds to a file.
    constexpr std::uint64_t bytes_per_object = 8192, bytes_per_leaf = 32;
    Budget budget(contents.file_bytes, 256, std::uint64_t{2} << 30);
    for (const Placed& node : layout->placed) {
        const Part& part = layout->parts[node.part];
        if (!part.tree) continue;
        if (!budget.spend(1, bytes_per_object + bytes_per_leaf * part.tree->leaf_count()))
            return Error{ErrorCode::unsupported,
                         name.string() + ": its " + grouped(layout->placed.size()) +
                             " nodes multiply to far more than the file holds; split the scene."};
        Object object{part.tree->share(), node.placement, node.node->name};
        object.texture_left_out = options.without_textures;
        object.origin = part.origin;
        object.measurement = part.measurement;
        object.node = node.node->node;
        object.mesh = node.node->mesh;
        (node.node->is_background ? scene.backdrop : scene.objects).push_back(std::move(object));
    }
    if (is_lit) {
        auto rig =
            contents.lights.empty()
                ? light_rig()
                : lights_of(contents, middle_of(scene.objects.empty() ? scene.backdrop : scene.objects), name, options);
        if (!rig) return rig.error();
        scene.lights = std::move(*rig);
    }
    scene.camera = contents.camera;
    if (scene.camera) scene.camera->eye *= options.unit_metres;
    scene.source = std::make_shared<const meshio::SceneSource>(contents.source);
    return scene;
}

} // namespace unseen::session
