#include <unseen/meshio/scene_file.h>

#include <numbers>
#include <set>

#include <unseen/vdtree/colour.h>

#include "file_output.h"
#include "gltf_meshes.h"
#include "gltf_nodes.h"
#include "text_scanner.h"

namespace unseen::meshio {

namespace fs = std::filesystem;
using gltf::json;
using gltf::member;
using gltf::numbered;
using gltf::within;

namespace {

constexpr double usual_outer_radians = std::numbers::pi / 4; // as the extension has it
constexpr double brightest = 1e12;                           // lux or candela: beyond is a mistake
constexpr const char* lights_extension = "KHR_lights_punctual";

bool is_finite_matrix(const glm::dmat4& m) {
    for (int c = 0; c < 4; ++c)
        for (int r = 0; r < 4; ++r)
            if (!std::isfinite(m[c][r])) return false;
    return true;
}

std::string name_in(const json& object) {
    const json& name = within(object, {"name"});
    return name.is_string() ? name.get<std::string>() : std::string();
}

bool is_background_name(std::string_view name) {
    constexpr std::string_view mark = "background";
    return equals_ignoring_case(name.substr(0, mark.size()), mark) &&
           (name.size() == mark.size() || !std::isalpha(static_cast<unsigned char>(name[mark.size()])));
}

// Whether an object of the extras says so.
bool says(const json& extras, const char* key, const std::string& where) {
    const json* said = extras.is_object() ? member(extras, key) : nullptr;
    if (said == nullptr) return false;
    if (!said->is_boolean()) fail(where, ".", key, " should be true or false; correct it.");
    return said->get<bool>();
}

double number_in(const json& object, const char* key, double missing, double low, double high,
                 const std::string& where) {
    const json* value = object.is_object() ? member(object, key) : nullptr;
    if (value == nullptr) return missing;
    const double number = value->is_number() ? value->get<double>() : std::nan("");
    if (!(number >= low && number <= high))
        fail(where, ": its ", key, " is no number in the range that it may have; correct it.");
    return number;
}

glm::dvec3 unit(glm::dvec3 v, const std::string& where) {
    const double largest = std::max({std::abs(v.x), std::abs(v.y), std::abs(v.z)});
    if (!(largest > 0) || !std::isfinite(largest)) fail(where, ": its transform leaves it no direction; correct it.");
    return glm::normalize(v / largest);
}

// Reads what nodes refer to.
class Contents {
public:
    Contents(const MeshSource& source, const json& document, const tinygltf::Model& model)
        : source_(source), document_(document), model_(model) {}

    SceneContents read() {
        const std::vector<gltf::ShownNode> shown = gltf::shown_nodes(source_, model_);
        std::vector<bool> is_background(shown.size());
        std::map<std::int32_t, int> uses;
        for (std::size_t i = 0; i < shown.size(); ++i) {
            const gltf::ShownNode& placed = shown[i];
            const json& node = gltf::array_of(document_, "nodes")[placed.node];
            const std::string where = quoted(numbered("node", placed.node), name_in(node));
            is_background[i] = (placed.parent != gltf::no_parent && is_background[placed.parent]) ||
                               is_background_name(name_in(node)) ||
                               says(within(node, {"extras", "unseen"}), "background", where + ": extras.unseen");
            contents_.is_scene = contents_.is_scene || is_background[i];
            const auto mesh = gltf::mesh_of(model_, placed.node);
            if ((mesh || has_camera(node) || light_of(node)) && !is_finite_matrix(placed.to_world))
                fail(where, ": its transform, with those above it, is NaN or infinite; correct it.");
            if (mesh) {
                add(placed, *mesh, name_in(node), is_background[i]);
                contents_.is_scene = contents_.is_scene || ++uses[static_cast<std::int32_t>(*mesh)] > 1;
            }
            add_light(node, placed.to_world, where);
            add_camera(node, placed.to_world, where);
        }
        if (model_.nodes.empty())
            for (std::size_t i = 0; i < model_.meshes.size(); ++i)
                contents_.nodes.push_back({model_.meshes[i].name.empty() ? numbered("mesh", i) : model_.meshes[i].name,
                                           -1, static_cast<std::int32_t>(i), glm::dmat4(1), false});
        if (const std::uint64_t hidden = gltf::hidden_meshes(document_, model_, shown); hidden > 0)
            contents_.warnings.push_back(counted_were(hidden, "node") +
                                         " not in the scene that is shown and left out.");
        contents_.is_scene = contents_.is_scene || contents_.camera || !contents_.lights.empty();
        read_light_settings();
        tell();
        return std::move(contents_);
    }

private:
    static std::string quoted(const std::string& number, const std::string& name) {
        return name.empty() ? number : number + " " + in_quotes(name);
    }

    void add(const gltf::ShownNode& placed, std::size_t mesh, std::string name, bool is_background) {
        if (name.empty()) name = model_.meshes[mesh].name;
        if (name.empty()) name = numbered("node", placed.node);
        contents_.nodes.push_back({std::move(name), static_cast<std::int32_t>(placed.node),
                                   static_cast<std::int32_t>(mesh), placed.to_world, is_background});
    }

    static const json* light_of(const json& node) {
        const json& extension = within(node, {"extensions", lights_extension});
        return extension.is_object() ? member(extension, "light") : nullptr;
    }
    static bool has_camera(const json& node) { return member(node, "camera") != nullptr; }

    // The element of an array that a node names.
    const json& element(const json& array, const json& index, const char* what, const std::string& where) const {
        const auto i = static_cast<std::size_t>(gltf::to_integer_in_range(index, gltf::max_int, where + ": " + what));
        if (i >= array.size())
            fail(where, " uses ", numbered(what, i), ", but there are ", array.size(), "; correct the JSON.");
        if (!array[i].is_object()) fail(where, " uses ", numbered(what, i), ", which is no object; correct the JSON.");
        return array[i];
    }

    void add_light(const json& node, const glm::dmat4& to_world, const std::string& of_node) {
        const json* index = light_of(node);
        if (index == nullptr) return;
        const json& extension = within(document_, {"extensions", lights_extension});
        const json& light =
            element(extension.is_object() ? gltf::array_of(extension, "lights") : extension, *index, "light", of_node);
        const std::string where = of_node + ": its light";
        SceneLight read;
        read.name = name_in(light);
        const json& kind = within(light, {"type"});
        if (kind == "point") read.kind = SceneLight::Kind::point;
        else if (kind == "spot") read.kind = SceneLight::Kind::spot;
        else if (kind != "directional") fail(where, " is neither directional, point nor spot; correct its type.");
        read.intensity = number_in(light, "intensity", 1, 0, brightest, where);
        if (const json* colour = member(light, "color")) {
            glm::vec3 rgb(1);
            if (!gltf::numbers_in(*colour, 0, brightest, rgb))
                fail(where, ": its color should be 3 numbers from 0 on; correct it.");
            has_coloured_ = has_coloured_ || rgb.r != rgb.g || rgb.g != rgb.b;
            read.intensity *= static_cast<double>(rec709_luminance(rgb));
        }
        has_range_ = has_range_ || member(light, "range") != nullptr;
        read.position = glm::dvec3(to_world[3]);
        if (read.kind != SceneLight::Kind::point) read.direction = unit(-glm::dvec3(to_world[2]), where);
        if (read.kind == SceneLight::Kind::spot) {
            const json& spot = within(light, {"spot"});
            constexpr double right_angle = std::numbers::pi / 2 + 1e-6; // rounded up from single floats
            read.inner_radians = number_in(spot, "innerConeAngle", 0, 0, right_angle, where);
            read.outer_radians = number_in(spot, "outerConeAngle", usual_outer_radians, 0, right_angle, where);
            read.outer_radians = std::min(read.outer_radians, std::numbers::pi / 2);
            if (!(read.inner_radians < read.outer_radians))
                fail(where, ": its innerConeAngle should be less than its outerConeAngle; correct it.");
        }
        read.casts_shadow = says(within(light, {"extras"}), "casts_shadow", where + ": extras") ||
                            says(within(node, {"extras"}), "casts_shadow", of_node + ": extras");
        contents_.lights.push_back(std::move(read));
    }

    void add_camera(const json& node, const glm::dmat4& to_world, const std::string& of_node) {
        const json* index = member(node, "camera");
        if (index == nullptr) return;
        const json& camera = element(gltf::array_of(document_, "cameras"), *index, "camera", of_node);
        const std::string where = of_node + ": its camera";
        if (within(camera, {"type"}) == "orthographic") {
            ++orthographic_;
            return;
        }
        const json& perspective = within(camera, {"perspective"});
        if (!perspective.is_object() || member(perspective, "yfov") == nullptr)
            fail(where, " has no perspective with a yfov; correct it.");
        constexpr double least = 1e-5, most = std::numbers::pi - 1e-3; // radians
        SceneCamera read;
        read.name = name_in(camera).empty() ? name_in(node) : name_in(camera);
        read.fov_y_degrees = number_in(perspective, "yfov", 1, least, most, where) * (180 / std::numbers::pi);
        read.eye = glm::dvec3(to_world[3]);
        read.forward = unit(-glm::dvec3(to_world[2]), where);
        const glm::dvec3 up = unit(glm::dvec3(to_world[1]), where);
        constexpr double least_sine = 1e-6;
        if (!(glm::length(glm::cross(read.forward, up)) > least_sine))
            fail(where, ": its transform is flat, so that up is along its sight; correct it.");
        read.up = up;
        contents_.is_scene = true;
        if (contents_.camera) ++further_cameras_;
        else contents_.camera = std::move(read);
    }

    void read_light_settings() {
        const json& unseen = within(document_, {"extras", "unseen"});
        constexpr double largest = 1e12;
        const std::string where = "extras.unseen";
        if (unseen.is_object() && member(unseen, "exposure") != nullptr)
            contents_.exposure = number_in(unseen, "exposure", 1, 1 / largest, largest, where);
        if (unseen.is_object() && member(unseen, "ambient") != nullptr)
            contents_.ambient = number_in(unseen, "ambient", 0, 0, 1, where);
    }

    void tell() {
        if (has_coloured_) contents_.notes.push_back("of coloured lights the luminance counts alone.");
        if (has_range_) contents_.notes.push_back("ranges of lights are not looked at: light falls off for ever.");
        if (further_cameras_ > 0)
            contents_.notes.push_back("the first of its " + std::to_string(further_cameras_ + 1) +
                                      " perspective cameras is taken.");
        if (orthographic_ > 0)
            contents_.notes.push_back("orthographic cameras are not looked through: pictures are in perspective.");
        std::set<std::string> extensions;
        for (const json& name : gltf::array_of(document_, "extensionsUsed"))
            if (name.is_string() && name.get_ref<const std::string&>().starts_with("KHR_materials_"))
                extensions.insert(name.get<std::string>());
        std::string list;
        for (const std::string& name : extensions) list += (list.empty() ? "" : ", ") + name;
        if (!list.empty())
            contents_.notes.push_back("surfaces are drawn matt: " + list + (extensions.size() == 1 ? " is" : " are") +
                                      " kept, and not looked at.");
    }

    const MeshSource& source_;
    const json& document_;
    const tinygltf::Model& model_;
    SceneContents contents_;
    bool has_coloured_ = false, has_range_ = false;
    int further_cameras_ = 0, orthographic_ = 0;
};

// ---- a document cut down to one of its meshes

struct Subset {
    json document;                           // one mesh, and the materials, textures, samplers and images that it uses
    std::vector<SourceDocument::File> files; // of these images
};

// Elements of one of the document's arrays that are taken over, in the order in which they are first named.
class Taken {
public:
    Taken(const json& document, const char* key) : all_(gltf::array_of(document, key)) {}

    // The new number. What is not there stays what it was: nobody can take it for another one.
    template <class Change>
    json number(const json& index, Change&& change) {
        const bool is_index = index.is_number_unsigned() && index.get<std::size_t>() < all_.size();
        if (!is_index) return index;
        const auto [entry, is_new] = numbers_.try_emplace(index.get<std::size_t>(), taken_.size());
        if (is_new) {
            taken_.push_back(all_[index.get<std::size_t>()]);
            from_.push_back(index.get<std::size_t>());
            json changed = taken_[entry->second];
            change(changed);
            taken_[entry->second] = std::move(changed);
        }
        return entry->second;
    }

    void put(json& out, const char* key) const {
        if (!taken_.empty()) out[key] = taken_;
    }
    const std::vector<std::size_t>& from() const { return from_; }

private:
    const json& all_;
    json taken_ = json::array();
    std::vector<std::size_t> from_;
    std::map<std::size_t, std::size_t> numbers_;
};

class Subsetter {
public:
    explicit Subsetter(const json& kept)
        : kept_(kept), materials_(kept, "materials"), textures_(kept, "textures"), samplers_(kept, "samplers"),
          images_(kept, "images") {}

    Subset run(const std::vector<SourceDocument::File>& files, std::size_t number) {
        json mesh = gltf::array_of(kept_, "meshes").at(number);
        for (json& primitive : mesh["primitives"])
            if (const auto material = primitive.find("material"); material != primitive.end())
                *material = materials_.number(*material, [&](json& of) { renumber_textures(of); });
        Subset subset;
        json& out = subset.document = json::object();
        for (const char* key : {"asset", "extensionsUsed", "extensionsRequired"})
            if (const json* value = member(kept_, key)) out[key] = *value;
        out["meshes"] = json::array({std::move(mesh)});
        materials_.put(out, "materials");
        textures_.put(out, "textures");
        samplers_.put(out, "samplers");
        images_.put(out, "images");
        for (const std::size_t from : images_.from())
            subset.files.push_back(from < files.size() ? files[from] : SourceDocument::File());
        return subset;
    }

private:
    // A material's textures are objects under keys that end so, with an index; extensions have such ones, too.
    void renumber_textures(json& value) {
        if (!value.is_structured()) return;
        for (auto& [key, inner] : value.items()) {
            if (key == "extras") continue;
            if (std::string_view(key).ends_with("Texture") && inner.is_object() && inner.contains("index"))
                inner["index"] = textures_.number(inner["index"], [&](json& texture) { renumber_sources(texture); });
            renumber_textures(inner);
        }
    }
    void renumber_sources(json& texture) {
        if (!texture.is_object()) return;
        const auto keep = [](json&) {};
        if (texture.contains("sampler")) texture["sampler"] = samplers_.number(texture["sampler"], keep);
        if (texture.contains("source")) texture["source"] = images_.number(texture["source"], keep);
        const auto extensions = texture.find("extensions");
        if (extensions == texture.end() || !extensions->is_object()) return;
        for (json& extension : *extensions)
            if (extension.is_object() && extension.contains("source"))
                extension["source"] = images_.number(extension["source"], keep);
    }

    const json& kept_;
    Taken materials_, textures_, samplers_, images_;
};

} // namespace

// In the order in which they refer to each other.
struct SceneFile::Impl {
    std::string bytes;
    ReadOptions options;
    MeshSource source;
    std::optional<gltf::File> file;
    SceneContents contents;
    json kept; // the document without geometry

    Impl(std::string bytes_, const fs::path& name, const ReadOptions& options_, const fs::path& folder)
        : bytes(std::move(bytes_)), options(options_), source{bytes, name.string(), folder, options} {}

    void read() {
        file.emplace(source);
        contents = Contents(source, file->document(), file->model()).read();
        contents.file_bytes = file->bytes();
        kept = file->kept(contents.source.files, contents.warnings);
        contents.source.json = gltf::to_text(kept);
    }
};

SceneFile::SceneFile(std::unique_ptr<Impl> impl) : impl_(std::move(impl)) {}
SceneFile::SceneFile(SceneFile&&) noexcept = default;
SceneFile& SceneFile::operator=(SceneFile&&) noexcept = default;
SceneFile::~SceneFile() = default;
const SceneContents& SceneFile::contents() const noexcept { return impl_->contents; }

Result<SceneFile> SceneFile::read(const fs::path& file, const ReadOptions& options) {
    Result<std::string> bytes = read_regular_file(file);
    if (!bytes) return bytes.error();
    return from_bytes(std::move(*bytes), file, options, file.has_parent_path() ? file.parent_path() : fs::path("."));
}

Result<SceneFile> SceneFile::from_bytes(std::string bytes, const fs::path& name, const ReadOptions& options,
                                        const fs::path& folder) {
    constexpr std::string_view utf8_mark = "\xEF\xBB\xBF";
    if (bytes.starts_with(utf8_mark)) bytes.erase(0, utf8_mark.size());
    auto impl = std::make_unique<Impl>(std::move(bytes), name, options, folder);
    return reported<SceneFile>(impl->source, [&] {
        gltf::with_types([&] { impl->read(); });
        return SceneFile(std::move(impl));
    });
}

Result<std::optional<ReadResult>> SceneFile::mesh(std::size_t mesh, const glm::dmat3& stretch) {
    using Read = std::optional<ReadResult>;
    const std::string& name = impl_->file->model().meshes[mesh].name;
    MeshSource source = impl_->source;
    source.name += ": " + numbered("mesh", mesh) + (name.empty() ? "" : " " + in_quotes(name));
    return reported<Read>(source, [&] {
        return gltf::with_types([&]() -> Read {
            source.report(source.bytes.size() / 2, "reading glTF");
            ReadResult read = impl_->file->read_mesh(mesh, stretch);
            if (read.mesh.triangles.empty() && !read.bad.any()) return std::nullopt;
            Subset subset = Subsetter(impl_->kept).run(impl_->contents.source.files, mesh);
            read.document->json = gltf::to_text(subset.document);
            read.document->files = std::move(subset.files);
            return finish_reading(source, std::move(read));
        });
    });
}

bool is_gltf_file(const fs::path& file) {
    const std::string ending = lower_ending(file);
    return ending == ".glb" || ending == ".gltf";
}

} // namespace unseen::meshio
