// glTF 2.0, as JSON and as GLB. tinygltf maps the JSON to its structures; everything it would believe or fetch is kept
// from it: the document is first cut down to what describes triangles (gltf_document.h), and buffers are resolved here
// (gltf_data.h), so that files cannot make it allocate, decode images or touch the file system.
#include <unordered_map>

#include "gltf_meshes.h"
#include "gltf_nodes.h"
#include "gltf_writer.h"
#include "named_files.h"
#include "restore.h"

namespace unseen::meshio {
namespace gltf {

namespace fs = std::filesystem;

namespace {

// Instancing multiplies a file, so what may come out is bounded: bytes for each byte read, and bytes in any case.
constexpr std::uint64_t max_bytes_out_per_byte_in = 64;
constexpr std::uint64_t min_bytes_out = std::uint64_t{16} << 20;
constexpr std::uint64_t bytes_per_vertex =
    sizeof(glm::dvec3) + sizeof(glm::vec3) + sizeof(glm::vec4) + sizeof(glm::vec2);
constexpr std::uint64_t bytes_per_visit = 64;                // of a primitive: takes time even where it is empty
constexpr std::uint64_t bytes_per_index = sizeof(Index) * 3; // in a strip an index makes a triangle

// ---- images ----

// Images as files, straight from the document: each is read once.
class ImageReader {
public:
    // `spend` is told of all bytes of images in the file, and fails where they are too many.
    ImageReader(const MeshSource& source, const json& document, const Buffers& buffers,
                Callback<void(std::uint64_t)> spend)
        : images_(array_of(document, "images")), views_(array_of(document, "bufferViews")), buffers_(buffers),
          files_(source), spend_(std::move(spend)), read_(images_.size()) {}

    // Null bytes: it could not be read, for the reason told.
    const NamedFile& read(std::size_t index) {
        std::optional<NamedFile>& image = read_[index];
        if (image) return *image;
        try {
            image = read_anew(images_[index], numbered("image", index));
        } catch (const Fault& fault) {
            image = NamedFile{.why = fault.what.substr(0, fault.what.size() - 1)};
        }
        if (!image->bytes) return *image;
        const auto [known, is_new] = known_.try_emplace(*image->bytes, image->bytes);
        if (is_new && image->uri.empty()) spend_(image->bytes->size());
        image->bytes = known->second;
        return *image;
    }

    // All images, for who writes them again. Names of images that lie elsewhere are changed in the document.
    std::vector<SourceDocument::File> read_all(LostImages& lost) {
        std::vector<SourceDocument::File> all;
        for (std::size_t i = 0; i < images_.size(); ++i) {
            const NamedFile& image = read(i);
            if (!image.bytes) lost.add(image.why);
            all.push_back({.uri = image.uri, .bytes = image.bytes});
        }
        return all;
    }

private:
    NamedFile read_anew(const json& image, const std::string& where) {
        if (!image.is_object()) fail(where, " is no object; correct the JSON.");
        NamedFile file;
        if (const json* uri = member(image, "uri")) {
            if (!uri->is_string()) fail(where, ": its uri is no text; correct the JSON.");
            const auto& text = uri->get_ref<const std::string&>();
            if (text.starts_with("data:")) {
                file.bytes = std::make_shared<const std::string>(Buffers::decode_data(text, where));
                return file;
            }
            file = files_.find(decode_percent(text));
            const auto path = plain_path(decode_percent(text));
            file.uri = file.bytes && path && *path != file.uri ? to_uri(file.uri) : text;
            if (!file.bytes) file.why = where + ": " + file.why;
            return file;
        }
        const json* view_index = member(image, "bufferView");
        if (view_index == nullptr) fail(where, " has no bufferView; correct the JSON.");
        const auto index = static_cast<std::size_t>(to_integer_in_range(*view_index, max_int, where + ": bufferView"));
        if (index >= views_.size() || !views_[index].is_object())
            fail(where, ": its bufferView is ", index, ", but there are ", views_.size(),
                 " bufferViews; correct the JSON.");
        const auto number = [&](const char* key, std::int64_t missing) {
            const json* value = member(views_[index], key);
            const std::string view = numbered("bufferViews", index);
            if (value == nullptr && missing < 0) fail(view, " has no ", key, "; correct the JSON.");
            return static_cast<std::size_t>(value ? to_integer_in_range(*value, max_size, view + ": " + key) : missing);
        };
        const std::size_t buffer = number("buffer", -1), offset = number("byteOffset", 0),
                          length = number("byteLength", -1);
        if (buffer >= buffers_.count() || offset > buffers_[buffer].size() || length > buffers_[buffer].size() - offset)
            fail(where, " ends behind its buffer; the data are cut short or the JSON is wrong.");
        if (length == 0) fail(where, " is empty; correct the JSON.");
        file.bytes = std::make_shared<const std::string>(buffers_[buffer].substr(offset, length));
        return file;
    }

    const json& images_;
    const json& views_;
    const Buffers& buffers_;
    NamedFiles files_;
    Callback<void(std::uint64_t)> spend_;
    std::vector<std::optional<NamedFile>> read_;
    std::map<std::string_view, std::shared_ptr<const std::string>> known_; // images with the same bytes are one
};

// ---- materials ----

// The colours and images of materials, straight from the document.
class MaterialReader {
public:
    // `images`: null: colours only.
    MaterialReader(const json& document, ImageReader* images) : document_(document), images_(images) {}

    // Alpha counts where it is not said to be ignored. What is wrong loses the material its textures, or its colour.
    Material read(std::size_t index, std::string name, std::vector<Message>& warnings, LostImages& lost) {
        Material material{.name = std::move(name)};
        const json& of_file = array_of(document_, "materials")[index];
        material.undrawn = undrawn(of_file);
        material.is_unlit = material.undrawn.erase("KHR_materials_unlit") > 0;
        const auto try_to = [&](auto&& read_part) {
            where_ = numbered("material", index);
            try {
                read_part();
            } catch (const Fault& fault) {
                warnings.push_back(fault.what + " Material " + in_quotes(material.name) + " is drawn without that.");
            }
        };
        try_to([&] { read_surface(of_file, material, lost); });
        if (material.is_unlit) { // by its colour alone
            material.undrawn.erase("metalness"), material.undrawn.erase("occlusion maps");
            return material;
        }
        try_to([&] { read_relief(of_file, material, lost); });
        try_to([&] { read_emission(of_file, material, lost); });
        return material;
    }

private:
    // What else than what is read below shows.
    std::set<std::string> undrawn(const json& of_file) const {
        std::set<std::string> all;
        if (images_ != nullptr && within(of_file, {"occlusionTexture"}).is_object()) all.insert("occlusion maps");
        const json& metalness = within(of_file, {"pbrMetallicRoughness", "metallicFactor"});
        const bool has_map = within(of_file, {"pbrMetallicRoughness", "metallicRoughnessTexture"}).is_object();
        if (metalness.is_number() ? metalness > 0 : has_map) all.insert("metalness");
        if (const json* extensions = member(of_file, "extensions"); extensions != nullptr && extensions->is_object())
            for (const auto& [name, value] : extensions->items())
                if (name.starts_with("KHR_materials_") && name != "KHR_materials_ior" &&
                    name != "KHR_materials_emissive_strength")
                    all.insert(name);
        return all;
    }

    void read_surface(const json& of_file, Material& material, LostImages& lost) {
        const json* surface = optional_object(of_file, "pbrMetallicRoughness");
        if (surface == nullptr) return;
        if (const json* factor = member(*surface, "baseColorFactor")) material.colour = colour(*factor);
        const json* mode = member(of_file, "alphaMode");
        if (mode == nullptr || *mode == "OPAQUE") material.colour.a = 1;
        material.blends = mode != nullptr && *mode == "BLEND";
        const json* texture = optional_object(*surface, "baseColorTexture");
        if (images_ == nullptr || texture == nullptr) return;
        if (!uv_set_of(*texture))
            fail(where_, ": its texture lies by texture coordinates that are not read, which are 0 to ", last_uv_set,
                 ".");
        if (mode != nullptr && *mode == "MASK") cut_out(of_file, material);
        material.uv_map = transform_of(*texture);
        std::tie(material.wrap_u, material.wrap_v) = wrapping_of(*texture);
        if (const auto image = image_of(*texture, material, lost)) {
            material.image = decode_percent(image->uri);
            material.image_bytes = image->bytes;
        }
    }

    void read_relief(const json& of_file, Material& material, LostImages& lost) {
        const json* texture = optional_object(of_file, "normalTexture");
        if (images_ == nullptr || texture == nullptr) return;
        if (const json* scale = member(*texture, "scale")) {
            if (!scale->is_number()) fail(where_, ": the scale of its normalTexture should be a number; correct it.");
            material.normal_scale = scale->get<float>();
        }
        material.normal_map = further_map(of_file, *texture, "normal maps", material, lost);
    }

    void read_emission(const json& of_file, Material& material, LostImages& lost) {
        glm::dvec3 factor(0);
        const json* given = member(of_file, "emissiveFactor");
        if (given != nullptr && !numbers_in(*given, 0, 1, factor))
            fail(where_, ": its emissiveFactor should be 3 numbers from 0 to 1; correct it.");
        const json& strength = within(of_file, {"extensions", "KHR_materials_emissive_strength", "emissiveStrength"});
        constexpr double most = 1e4; // beyond what any display shows
        if (strength.is_number()) factor *= std::clamp(strength.get<double>(), 0.0, most);
        material.emission = glm::vec3(factor);
        const json* texture = optional_object(of_file, "emissiveTexture");
        if (images_ == nullptr || texture == nullptr || !material.shines()) return;
        material.emission_map = further_map(of_file, *texture, "emission", material, lost);
        if (!material.emission_map) material.emission = glm::vec3(0);
    }

    // An image that lies as the leading one does; none where it does not, which is noted by its name.
    std::shared_ptr<const std::string> further_map(const json& of_file, const json& texture, const char* name,
                                                   Material& material, LostImages& lost) {
        const json& leading = leading_texture(of_file);
        const Wrapping of_leading = wrapping_of(leading), own = wrapping_of(texture);
        if (!uv_set_of(texture) || uv_set_of(texture) != uv_set_of(leading) ||
            transform_of(texture) != transform_of(leading) || own != of_leading) {
            material.undrawn.insert(std::string(name) + " with coordinates or a sampler of their own");
            return nullptr;
        }
        if (&texture == &leading) {
            material.uv_map = transform_of(texture);
            std::tie(material.wrap_u, material.wrap_v) = own;
        }
        const auto image = image_of(texture, material, lost);
        return image ? image->bytes : nullptr;
    }

    // By the image's alpha times the factor's, so that the rest is opaque.
    void cut_out(const json& of_file, Material& material) const {
        const json* cutoff = member(of_file, "alphaCutoff");
        if (cutoff != nullptr && !(cutoff->is_number() && *cutoff >= 0))
            fail(where_, ": its alphaCutoff should be a number, 0 or more; correct it.");
        const float factor = std::exchange(material.colour.a, 1.0f);
        const float least = cutoff != nullptr ? cutoff->get<float>() : 0.5f;
        material.alpha_cutoff = least <= factor ? least / std::max(factor, 1e-6f) : 2.0f;
    }

    const json* optional_object(const json& in, const char* key) const {
        const json* value = member(in, key);
        if (value != nullptr && !value->is_object()) fail(where_, ": its ", key, " is no object; correct the JSON.");
        return value;
    }

    glm::vec4 colour(const json& values) const {
        glm::vec4 colour(1);
        if (!numbers_in(values, 0, 1, colour))
            fail(where_, ": its baseColorFactor should be 4 numbers from 0 to 1; correct it.");
        return colour;
    }

    const json& element(const char* key, const json& in, const char* of) {
        const json& array = array_of(document_, key);
        const json* value = member(in, of);
        if (value == nullptr) fail(where_, " has no ", of, "; correct the JSON.");
        const auto index = static_cast<std::size_t>(to_integer_in_range(*value, max_int, where_ + ": " + of));
        if (index >= array.size())
            fail(where_, ": its ", of, " is ", index, ", but there are ", array.size(), " ", key,
                 "; correct the JSON.");
        if (!array[index].is_object()) fail(where_, ": its ", of, " is no object; correct the JSON.");
        where_ = numbered(std::string(key, std::string_view(key).size() - 1).c_str(), index); // "texture 3"
        return array[index];
    }

    using Wrapping = std::pair<Wrap, Wrap>;
    Wrapping wrapping_of(const json& info) {
        const std::string of_material = where_;
        Wrapping found{Wrap::repeat, Wrap::repeat};
        const json& texture = element("textures", info, "index");
        if (member(texture, "sampler") != nullptr) {
            const json& sampler = element("samplers", texture, "sampler");
            found = {wrap(sampler, "wrapS"), wrap(sampler, "wrapT")};
        }
        where_ = of_material;
        return found;
    }

    // None: it was not found or is of no known kind, which is noted.
    std::optional<NamedFile> image_of(const json& info, const Material& material, LostImages& lost) {
        const json& texture = element("textures", info, "index");
        if (member(texture, "source") == nullptr) {
            const TextureSource other = source_of(texture);
            if (!other.extension.empty()) {
                lost.add(where_ + " is an image of the extension " + other.extension + ", which is not decoded");
                lost.materials.insert(material.name);
                return std::nullopt;
            }
        }
        element("images", texture, "source"); // it is there
        const NamedFile& image =
            images_->read(static_cast<std::size_t>(to_integer_in_range(texture["source"], max_int, where_)));
        if (image.bytes) return image;
        lost.add(image.why);
        lost.materials.insert(material.name);
        return std::nullopt;
    }

    UvMap transform_of(const json& info) const {
        const json* extensions = optional_object(info, "extensions");
        const json* transform = extensions ? optional_object(*extensions, "KHR_texture_transform") : nullptr;
        return transform != nullptr ? uv_map(*transform) : UvMap{};
    }

    // KHR_texture_transform: scaled, turned and moved.
    UvMap uv_map(const json& transform) const {
        constexpr double any = std::numeric_limits<double>::infinity();
        const auto numbers = [&](const char* key, glm::dvec2 value) {
            const json* values = member(transform, key);
            if (values != nullptr && !numbers_in(*values, -any, any, value))
                fail(where_, ": the ", key, " of its texture should be 2 numbers; correct it.");
            return value;
        };
        const json* rotation = member(transform, "rotation");
        if (rotation != nullptr && !rotation->is_number())
            fail(where_, ": the rotation of its texture should be a number; correct it.");
        const double angle = rotation != nullptr ? rotation->get<double>() : 0.0;
        const glm::dvec2 scale = numbers("scale", glm::dvec2(1));
        const double c = std::cos(angle), s = std::sin(angle);
        return {glm::dmat2(scale.x * c, -scale.x * s, scale.y * s, scale.y * c), numbers("offset", glm::dvec2(0))};
    }

    static Wrap wrap(const json& sampler, const char* key) {
        constexpr int clamps = 33071, mirrors = 33648;
        const json* value = member(sampler, key);
        if (value == nullptr) return Wrap::repeat;
        return *value == clamps ? Wrap::clamp : *value == mirrors ? Wrap::mirror : Wrap::repeat;
    }

    const json& document_;
    ImageReader* images_;
    std::string where_;
};

// ---- transforms ----

// How positions, normals and orientation go to the world.
struct Placement {
    glm::dmat4 matrix{1.0};
    glm::dmat3 normal_matrix{1.0};
    bool is_mirrored = false;
};

Placement placement_of(const glm::dmat4& matrix) {
    Placement placement;
    placement.matrix = matrix;
    glm::dmat3 linear(matrix);
    double size = 0.0;
    for (int i = 0; i < 9; ++i) size = std::max(size, std::abs(linear[i / 3][i % 3]));
    if (size > 0.0 && std::isfinite(size)) linear /= size; // a determinant of tiny scales would underflow
    const NormalMatrix normals = normal_matrix_of(linear);
    placement.is_mirrored = normals.is_mirrored;
    placement.normal_matrix = normals.matrix;
    return placement;
}

glm::vec3 placed_normal(const Placement& placement, const glm::dvec3& normal) {
    const glm::dvec3 n = placement.normal_matrix * normal;
    const double length = glm::length(n);
    return length > 0.0 && std::isfinite(length) ? glm::vec3(n / length) : missing_normal;
}

// ---- scene ----

class SceneReader {
public:
    SceneReader(const MeshSource& source, const json& document, const tinygltf::Model& model, const Buffers& buffers)
        : source_(source), whole_(document), model_(model), accessors_(model, buffers),
          budget_(source.bytes.size() + buffers.external_bytes(), max_bytes_out_per_byte_in, min_bytes_out) {
        for (std::size_t i = 0; i < model.materials.size(); ++i) first_of_name_.try_emplace(model.materials[i].name, i);
        for (const json& material : array_of(document, "materials")) {
            const json& texture = leading_texture(material);
            uv_sets_.push_back(uv_set_of(texture).value_or(0));
            is_textured_.push_back(!texture.is_null());
        }
    }

    ReadResult read() {
        const std::vector<ShownNode> shown = shown_nodes(source_, model_);
        if (model_.nodes.empty())
            for (std::size_t i = 0; i < model_.meshes.size(); ++i) add_mesh(i, -1, Placement{});
        for (const ShownNode& node : shown) {
            source_.report(source_.bytes.size() / 2, "reading glTF");
            if (const auto mesh = mesh_of(model_, node.node))
                add_mesh(*mesh, static_cast<std::int32_t>(node.node), placement_of(node.to_world));
        }
        tell_of_parts();
        if (const std::uint64_t hidden = hidden_meshes(whole_, model_, shown); hidden > 0)
            result_.warnings.push_back(counted_were(hidden, "node") + " not in the scene that is shown and left out.");
        keep_channels();
        return std::move(result_);
    }

    // One mesh alone, stretched; its parts count as those of mesh 0, and of no node.
    ReadResult read_mesh(std::size_t mesh, const glm::dmat3& stretch) {
        result_ = {};
        document_ = {};
        used_materials_.clear();
        skipped_primitives_ = triangles_without_uvs_ = 0;
        add_mesh(mesh, -1, placement_of(glm::dmat4(stretch)));
        for (SourceDocument::Part& part : document_.parts) part.mesh = 0;
        tell_of_parts();
        keep_channels();
        return std::exchange(result_, {});
    }

    // After read(): of the file, those that triangles have.
    void read_materials(MaterialReader& reader, ReadResult& result, LostImages& lost) const {
        for (const std::size_t index : used_materials_)
            result.materials.push_back(
                reader.read(index, material_name(static_cast<int>(index)), result.warnings, lost));
    }

    void spend(std::uint64_t count, std::uint64_t bytes_each) {
        if (!budget_.spend(count, bytes_each))
            fail("its instances and shared data multiply to far more than the file holds; split the scene.");
    }

private:
    void tell_of_parts() {
        if (skipped_primitives_ > 0)
            result_.warnings.push_back(counted_were(skipped_primitives_, "primitive") +
                                       " left out for having no triangles or no positions.");
        if (source_.options.images) warn_of_missing_uvs(triangles_without_uvs_, result_);
    }

    // Accessors of a primitive's vertices, by attribute. Primitives of one mesh with the same ones, of which the same
    // are drawn, share their vertices.
    using VertexSource = std::map<std::string, int>;

    // The coordinates by which the texture of a primitive lies.
    std::string uvs_of(const tinygltf::Primitive& primitive) const {
        const auto material = static_cast<std::size_t>(primitive.material); // -1: there is none of that number
        return uv_attribute(material < uv_sets_.size() ? uv_sets_[material] : 0);
    }

    void add_mesh(std::size_t index, std::int32_t node, const Placement& placement) {
        const tinygltf::Mesh& mesh = model_.meshes[index];
        std::map<std::pair<VertexSource, std::string>, Index> first_vertices;
        for (std::size_t i = 0; i < mesh.primitives.size(); ++i) {
            const tinygltf::Primitive& primitive = mesh.primitives[i];
            spend(1, bytes_per_visit);
            const bool has_triangles = primitive.mode == TINYGLTF_MODE_TRIANGLES ||
                                       primitive.mode == TINYGLTF_MODE_TRIANGLE_STRIP ||
                                       primitive.mode == TINYGLTF_MODE_TRIANGLE_FAN;
            const VertexSource& vertices = primitive.attributes;
            if (!has_triangles || !vertices.contains("POSITION")) {
                ++skipped_primitives_;
                continue;
            }
            const std::string uvs = uvs_of(primitive);
            const auto [first, is_new] =
                first_vertices.try_emplace({vertices, uvs}, static_cast<Index>(result_.mesh.positions.size()));
            if (is_new) add_vertices(vertices, uvs, placement);
            const std::uint64_t first_triangle = result_.mesh.triangles.size();
            add_triangles(mesh, primitive, first->second, accessors_.count_of(vertices.at("POSITION")),
                          placement.is_mirrored);
            if (result_.mesh.triangles.size() == first_triangle) continue;
            const auto material = static_cast<std::size_t>(primitive.material);
            if (material < is_textured_.size() && is_textured_[material] && !vertices.contains(uvs))
                triangles_without_uvs_ += result_.mesh.triangles.size() - first_triangle;
            spend(1, sizeof(SourceDocument::Part) + sizeof(SourceDocument::Run));
            document_.runs.push_back({first_triangle, static_cast<std::uint32_t>(document_.parts.size())});
            document_.parts.push_back({.node = node,
                                       .mesh = static_cast<std::int32_t>(index),
                                       .primitive = static_cast<std::int32_t>(i),
                                       .to_world = placement.matrix,
                                       .channels = channels_of(vertices)});
        }
    }

    // What is kept as the file has it: all but positions.
    std::size_t channel(const std::string& attribute, int accessor) {
        const auto components = static_cast<std::uint32_t>(accessors_.components_of(accessor));
        auto& channels = document_.channels;
        for (std::size_t i = 0; i < channels.size(); ++i)
            if (channels[i].name == attribute && channels[i].components == components) return i;
        channels.push_back({attribute, components, {}});
        return channels.size() - 1;
    }
    std::uint32_t channels_of(const VertexSource& vertices) {
        std::uint32_t bits = 0;
        for (const auto& [attribute, accessor] : vertices)
            if (attribute != "POSITION") bits |= std::uint32_t{1} << channel(attribute, accessor);
        return bits;
    }
    void keep(const std::string& attribute, int accessor, std::size_t first, const std::vector<glm::dvec4>& values) {
        SourceDocument::Channel& kept = document_.channels[channel(attribute, accessor)];
        spend(first + values.size() - kept.values.size() / kept.components, kept.components * sizeof(float));
        kept.values.resize(first * kept.components);
        for (const glm::dvec4& value : values)
            for (int k = 0; k < static_cast<int>(kept.components); ++k)
                kept.values.push_back(static_cast<float>(value[k]));
    }
    void keep_channels() {
        for (SourceDocument::Channel& kept : document_.channels) {
            const std::size_t size = result_.mesh.positions.size() * kept.components;
            spend(size - kept.values.size(), sizeof(float));
            kept.values.resize(size);
        }
        result_.document = std::move(document_);
    }

    void add_vertices(const VertexSource& from, const std::string& uvs, const Placement& placement) {
        Mesh& mesh = result_.mesh;
        const std::size_t first = mesh.positions.size();
        const std::size_t count = accessors_.count_of(from.at("POSITION"));
        for (const auto& [attribute, accessor] : from) {
            if (accessors_.count_of(accessor) != count)
                fail(numbered("accessor", static_cast<std::size_t>(accessor)), " has ", accessors_.count_of(accessor),
                     " elements for ", count, " positions; correct the JSON.");
        }
        spend(count, bytes_per_vertex);
        if (count >= std::numeric_limits<Index>::max() - first)
            fail("it has more vertices than 32-bit indices can number; split the scene.");
        for (const auto& [attribute, accessor] : from) add_attribute(attribute, accessor, first, uvs, placement);
        if (!mesh.normals.empty()) mesh.normals.resize(mesh.positions.size(), missing_normal);
        if (!mesh.uvs.empty()) mesh.uvs.resize(mesh.positions.size(), glm::vec2(0.0f));
        if (!mesh.colours.empty()) mesh.colours.resize(mesh.positions.size(), missing_colour);
    }

    void add_attribute(const std::string& attribute, int accessor, std::size_t first, const std::string& uvs,
                       const Placement& placement) {
        Mesh& mesh = result_.mesh;
        if (attribute == "POSITION") {
            for (const glm::dvec4& p : accessors_.vectors(accessor, 3, "positions")) {
                mesh.positions.push_back(glm::dvec3(placement.matrix * glm::dvec4(p.x, p.y, p.z, 1.0)));
                check_position(result_.bad, mesh.positions.back(), [&] {
                    return numbered("vertex", mesh.positions.size() - 1 - first) + " of " +
                           numbered("accessor", static_cast<std::size_t>(accessor));
                });
            }
            return;
        }
        const bool is_colour = attribute.starts_with("COLOR_"), is_normal = attribute == "NORMAL";
        const auto values = is_colour   ? accessors_.vectors(accessor, 0, "colours")
                            : is_normal ? accessors_.vectors(accessor, 3, "normals")
                                        : accessors_.vectors(accessor, 2, "texture coordinates");
        if (is_normal) {
            mesh.normals.resize(first, missing_normal);
            for (const glm::dvec4& n : values) mesh.normals.push_back(placed_normal(placement, glm::dvec3(n)));
        } else if (attribute == uvs) {
            mesh.uvs.resize(first, glm::vec2(0.0f));
            for (const glm::dvec4& uv : values) mesh.uvs.emplace_back(uv.x, uv.y);
        } else if (attribute == "COLOR_0") {
            mesh.colours.resize(first, missing_colour);
            for (const glm::dvec4& c : values) mesh.colours.emplace_back(c);
        }
        keep(attribute, accessor, first, values);
    }

    void add_triangles(const tinygltf::Mesh& mesh, const tinygltf::Primitive& primitive, Index first, std::size_t count,
                       bool is_mirrored) {
        const std::size_t index_count = primitive.indices >= 0 ? accessors_.count_of(primitive.indices) : count;
        spend(index_count, bytes_per_index);
        std::vector<Index> indices;
        if (primitive.indices >= 0) indices = accessors_.indices(primitive.indices);
        const auto number = [&](std::size_t i) { return indices.empty() ? static_cast<Index>(i) : indices[i]; };
        // False where the triangle is to be left out.
        const auto is_good = [&](const std::array<std::size_t, 3>& corners) {
            for (const std::size_t i : corners) {
                if (number(i) < count) continue;
                leave_out_face(result_.bad, [&] {
                    return text_of("mesh ", in_quotes(mesh.name), ": index ", i, " names vertex ", number(i),
                                   ", but there are ", count);
                });
                return false;
            }
            if (result_.bad.vertices == 0) return true;
            for (const std::size_t i : corners) {
                if (is_finite(result_.mesh.positions[first + number(i)])) continue;
                ++result_.bad.left_out;
                return false;
            }
            return true;
        };
        const bool is_list = primitive.mode == TINYGLTF_MODE_TRIANGLES;
        if (is_list && index_count % 3 != 0)
            fail("mesh ", in_quotes(mesh.name), ": ", index_count,
                 " indices make no whole number of triangles; correct it.");
        const std::uint64_t first_triangle = result_.mesh.triangles.size();
        for (std::size_t i = 2; i < index_count; i += is_list ? 3 : 1) {
            ++result_.source_faces;
            const std::size_t start = primitive.mode == TINYGLTF_MODE_TRIANGLE_FAN ? 0 : i - 2;
            if (!is_good({start, i - 1, i})) continue;
            Triangle triangle{first + number(start), first + number(i - 1), first + number(i)};
            const bool is_odd_in_strip = primitive.mode == TINYGLTF_MODE_TRIANGLE_STRIP && i % 2 != 0;
            if (is_odd_in_strip != is_mirrored) std::swap(triangle[0], triangle[1]);
            result_.mesh.triangles.push_back(triangle);
        }
        const std::uint64_t added = result_.mesh.triangles.size() - first_triangle;
        if (added == 0) return;
        if (primitive.material >= 0) {
            used_materials_.insert(static_cast<std::size_t>(primitive.material));
            add_range(material_name(primitive.material), MeshRange::Kind::material, first_triangle, added);
        }
        add_range(mesh.name, MeshRange::Kind::primitive, first_triangle, added);
    }

    // Names are repeated with every instance, so they count as well.
    void add_range(const std::string& name, MeshRange::Kind kind, std::uint64_t first, std::uint64_t count) {
        spend(1, sizeof(MeshRange) + name.size());
        result_.mesh.ranges.push_back({name, kind, first, count});
    }

    std::string material_name(int material) const {
        const auto index = static_cast<std::size_t>(material);
        if (index >= model_.materials.size())
            fail("material ", material, " is used, but there are ", model_.materials.size(), "; correct the JSON.");
        const std::string& name = model_.materials[index].name;
        if (!name.empty() && first_of_name_.at(name) != index) return name + " (" + numbered("material", index) + ")";
        return name.empty() ? numbered("material", index) : name;
    }

    const MeshSource& source_;
    const json& whole_;
    const tinygltf::Model& model_;
    Accessors accessors_;
    ReadResult result_;
    std::set<std::size_t> used_materials_;
    std::vector<std::uint32_t> uv_sets_;                         // by material
    std::vector<bool> is_textured_;                              // by material
    std::unordered_map<std::string, std::size_t> first_of_name_; // of materials
    SourceDocument document_;
    Budget budget_;
    std::uint64_t skipped_primitives_ = 0, triangles_without_uvs_ = 0;
};

} // namespace

struct File::Impl {
    explicit Impl(const MeshSource& from) : source(from) {
        Container container{source.bytes, std::nullopt};
        if (source.bytes.starts_with("glTF")) container = split_glb(source.bytes);
        document = parse_json(container.json_text);
        source.report(source.bytes.size() / 4, "reading glTF");
        check_kept(document, source.options.drop, warnings);
        buffers.emplace(source, document, container.bin);
        unpack_views(document, *buffers);
        expand_instances(document, *buffers, warnings);
        reduced = reduce(document);
        if (reduced.has_tangents)
            warnings.push_back("tangents were left out; they follow from normals and coordinates.");
        if (reduced.has_other_attributes) warnings.push_back("vertex attributes that are not known were left out.");
        scene.emplace(source, document, reduced.model, *buffers);
        images.emplace(source, document, *buffers, [this](std::uint64_t bytes) { scene->spend(1, bytes); });
        materials.emplace(document, source.options.images ? &*images : nullptr);
    }

    // In the order in which they refer to each other.
    const MeshSource& source;
    json document;
    std::vector<Message> warnings; // of the document
    std::optional<Buffers> buffers;
    Reduced reduced;
    std::optional<SceneReader> scene;
    std::optional<ImageReader> images;
    std::optional<MaterialReader> materials;
};

File::File(const MeshSource& source) : impl_(std::make_unique<Impl>(source)) {}
File::~File() = default;

const json& File::document() const { return impl_->document; }
const tinygltf::Model& File::model() const { return impl_->reduced.model; }
std::uint64_t File::bytes() const { return impl_->source.bytes.size() + impl_->buffers->external_bytes(); }

ReadResult File::read_all() {
    ReadResult result = impl_->scene->read();
    result.uvs_from_top = true;
    LostImages lost;
    result.document->files = impl_->images->read_all(lost);
    impl_->scene->read_materials(*impl_->materials, result, lost);
    if (impl_->source.options.images) warn_of_lost_images(lost, result.mesh.ranges, result.warnings);
    warn_of_undrawn(result);
    result.warnings.insert(result.warnings.end(), impl_->warnings.begin(), impl_->warnings.end());
    result.document->json = to_text(without_geometry(impl_->document, result.document->files, result.warnings));
    return result;
}

ReadResult File::read_mesh(std::size_t mesh, const glm::dmat3& stretch) {
    ReadResult result = impl_->scene->read_mesh(mesh, stretch);
    result.uvs_from_top = true;
    LostImages lost;
    impl_->scene->read_materials(*impl_->materials, result, lost);
    warn_of_lost_images(lost, result.mesh.ranges, result.warnings);
    warn_of_undrawn(result);
    return result;
}

json File::kept(std::vector<SourceDocument::File>& images, std::vector<Message>& warnings) {
    warnings.insert(warnings.end(), impl_->warnings.begin(), impl_->warnings.end());
    LostImages lost;
    images = impl_->images->read_all(lost);
    warn_of_lost_images(lost, {}, warnings);
    return without_geometry(impl_->document, images, warnings);
}

} // namespace gltf

ReadResult read_gltf(const MeshSource& source) {
    return gltf::with_types([&] { return gltf::File(source).read_all(); });
}

} // namespace unseen::meshio
