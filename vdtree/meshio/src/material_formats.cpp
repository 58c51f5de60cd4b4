#include "write_cut.h"

#include <sstream>

#include <unseen/vdtree/colour.h>

#include "file_output.h"
#include "gltf_data.h"
#include "gltf_document.h"
#include "gltf_writer.h"
#include "mesh_readers.h"
#include "mtl_reader.h"
#include "restore.h"

namespace unseen::meshio {

namespace fs = std::filesystem;
using gltf::within;
using nlohmann::json;

namespace {

using File = SourceDocument::File;
using Part = SourceDocument::Part;

// v runs downward in images of glTF, and upward in those of OBJ.
void turn_uvs_upside_down(SourceDocument& document) {
    for (auto& channel : document.channels)
        if (channel.name.starts_with("TEXCOORD_") && channel.components == 2)
            for (std::size_t i = 1; i < channel.values.size(); i += 2) channel.values[i] = 1 - channel.values[i];
    for (Part& part : document.parts) {
        part.drawn_uv.offset += part.drawn_uv.linear[1];
        part.drawn_uv.linear[1] = -part.drawn_uv.linear[1];
    }
}

void for_each_normal(SourceDocument& document, auto&& change) {
    for (auto& channel : document.channels) {
        if (channel.name != "NORMAL" || channel.components != 3) continue;
        for (std::size_t v = 0; v < document.vertex_parts.size(); ++v) {
            float* const at = &channel.values[3 * v];
            const glm::dvec3 n = change(glm::dvec3(at[0], at[1], at[2]), document.parts[document.vertex_parts[v]]);
            const double length = glm::length(n);
            for (int k = 0; k < 3; ++k) at[k] = length > 0 ? static_cast<float>(n[k] / length) : 0.0f;
        }
    }
}

// ---- OBJ to glTF

json gltf_material(const Material& material, json& document, std::vector<File>& images,
                   std::map<fs::path, std::size_t>& image_numbers) {
    json surface = {{"metallicFactor", 0}, {"roughnessFactor", 1}};
    const glm::vec4& c = material.colour;
    if (c != glm::vec4(1)) surface["baseColorFactor"] = {c.r, c.g, c.b, c.a};
    if (material.has_image()) {
        const auto [found, is_new] = image_numbers.try_emplace(material.image, images.size());
        if (is_new) {
            File image{.uri = to_uri(material.image), .bytes = material.image_bytes};
            document["images"].push_back({{"uri", image.uri}});
            images.push_back(std::move(image));
        }
        constexpr int repeats = 10497, clamps = 33071;
        document["samplers"].push_back({{"wrapS", material.wrap_u == vdtree::Wrap::clamp ? clamps : repeats},
                                        {"wrapT", material.wrap_v == vdtree::Wrap::clamp ? clamps : repeats}});
        document["textures"].push_back({{"source", found->second}, {"sampler", document["samplers"].size() - 1}});
        surface["baseColorTexture"] = {{"index", document["textures"].size() - 1}};
    }
    json out = {{"name", material.name}, {"pbrMetallicRoughness", std::move(surface)}};
    if (c.a < 1) out["alphaMode"] = "BLEND";
    return out;
}

} // namespace

SourceDocument as_gltf(SourceDocument document, std::vector<Message>& notes) {
    if (document.format == SourceDocument::Format::gltf) return document;
    MtlContents contents;
    for (const File& file : document.files) {
        if (file.use != File::Use::library || !file.bytes) continue;
        const fs::path folder = fs::path(file.uri).parent_path();
        const auto find = [&](std::string_view name) {
            const auto path = plain_path(name);
            for (const fs::path& uri : {(folder / path.value_or("")).lexically_normal(), path.value_or("")})
                for (const File& image : document.files)
                    if (image.use == File::Use::image && image.uri == uri) return NamedFile{image.uri, image.bytes, {}};
            return NamedFile{};
        };
        read_mtl(*file.bytes, file.uri, find, folder, contents);
        notes.push_back("of the materials in " + in_quotes(file.uri) +
                        ", glTF gets colours, opacity and colour images; all else is left out.");
    }
    json out = {{"scene", 0},
                {"scenes", json::array({{{"nodes", json::array()}}})},
                {"nodes", json::array()},
                {"meshes", json::array()}};
    std::vector<File> images;
    std::map<fs::path, std::size_t> image_numbers;
    std::map<std::string, std::size_t> materials, nodes;
    for (Part& part : document.parts) {
        const std::string& name = part.object.empty() ? part.group : part.object;
        const auto [node, is_new] = nodes.try_emplace(name, nodes.size());
        if (is_new) {
            json named = {{"mesh", node->second}}, mesh = {{"primitives", json::array()}};
            if (!name.empty()) named["name"] = mesh["name"] = name;
            out["nodes"].push_back(std::move(named));
            out["meshes"].push_back(std::move(mesh));
            out["scenes"][0]["nodes"].push_back(node->second);
        }
        json primitive = json::object();
        if (!part.material.empty()) {
            const auto [material, is_first] = materials.try_emplace(part.material, materials.size());
            if (is_first) {
                const auto known = std::find_if(contents.materials.begin(), contents.materials.end(),
                                                [&](const Material& m) { return m.name == part.material; });
                out["materials"].push_back(known == contents.materials.end()
                                               ? json{{"name", part.material}}
                                               : gltf_material(*known, out, images, image_numbers));
            }
            primitive["material"] = material->second;
        }
        json& primitives = out["meshes"][node->second]["primitives"];
        part.node = part.mesh = static_cast<std::int32_t>(node->second);
        part.primitive = static_cast<std::int32_t>(primitives.size());
        primitives.push_back(std::move(primitive));
    }
    document.format = SourceDocument::Format::gltf;
    document.json = gltf::to_text(out);
    document.files = std::move(images);
    turn_uvs_upside_down(document);
    for_each_normal(document, [](const glm::dvec3& n, const Part&) { return n; });
    return document;
}

// ---- glTF to OBJ

namespace {

// An element of one of the document's arrays, or null where there is none.
const json& at(const json& document, const char* array, const json& index) {
    static const json none;
    const json& elements = gltf::array_of(document, array);
    if (!index.is_number_unsigned() || index.get<std::size_t>() >= elements.size()) return none;
    const json& element = elements[index.get<std::size_t>()];
    return element.is_object() ? element : none;
}

double number_or(const json& value, double missing) { return value.is_number() ? value.get<double>() : missing; }

std::string ending_of(std::string_view bytes) {
    if (bytes.starts_with("\x89PNG")) return ".png";
    if (bytes.starts_with("RIFF") && bytes.substr(8).starts_with("WEBP")) return ".webp";
    if (bytes.starts_with("\xABKTX 20")) return ".ktx2";
    return bytes.starts_with("\xFF\xD8\xFF") ? ".jpg" : ".image";
}

// Writes the library and names its images.
class MtlWriter {
public:
    MtlWriter(const json& document, const std::string& stem, std::vector<File>& images)
        : document_(document), stem_(stem), images_(images) {}

    std::string write(const std::vector<std::string>& names) {
        const json& materials = gltf::array_of(document_, "materials");
        for (std::size_t i = 0; i < materials.size(); ++i) write(materials[i], names[i]);
        return text_.str();
    }
    bool lost_mirrors() const { return lost_mirrors_; }

private:
    void write(const json& material, const std::string& name) {
        text_.imbue(std::locale::classic());
        text_ << "newmtl " << one_line(name) << '\n';
        const json& surface = within(material, {"pbrMetallicRoughness"});
        write_colour("Kd", within(surface, {"baseColorFactor"}), 1);
        const json& factor = within(surface, {"baseColorFactor"});
        const bool is_opaque = within(material, {"alphaMode"}).is_null() || material["alphaMode"] == "OPAQUE";
        if (!is_opaque && factor.is_array() && factor.size() == 4) text_ << "d " << number_or(factor[3], 1) << '\n';
        write_image("map_Kd", within(surface, {"baseColorTexture"}));
        text_ << "Pm " << number_or(within(surface, {"metallicFactor"}), 1) << '\n';
        text_ << "Pr " << number_or(within(surface, {"roughnessFactor"}), 1) << '\n';
        write_image("norm", within(material, {"normalTexture"}));
        if (within(material, {"emissiveFactor"}).is_array()) write_colour("Ke", material["emissiveFactor"], 0);
        write_image("map_Ke", within(material, {"emissiveTexture"}));
    }
    void write_colour(const char* keyword, const json& factor, double missing) {
        text_ << keyword;
        for (std::size_t k = 0; k < 3; ++k)
            text_ << ' '
                  << linear_to_srgb(factor.is_array() && factor.size() > k ? number_or(factor[k], missing) : missing);
        text_ << '\n';
    }
    void write_image(const char* keyword, const json& use) {
        const json& texture = at(document_, "textures", within(use, {"index"}));
        const auto source = gltf::source_of(texture).image;
        if (!source || *source >= images_.size()) return;
        File& image = images_[*source];
        if (image.uri.empty())
            image.uri = stem_ + "_image" + std::to_string(*source) + (image.bytes ? ending_of(*image.bytes) : "");
        constexpr int clamps = 33071, mirrors = 33648;
        const json& sampler = at(document_, "samplers", within(texture, {"sampler"}));
        lost_mirrors_ |= within(sampler, {"wrapS"}) == mirrors || within(sampler, {"wrapT"}) == mirrors;
        text_ << keyword << (within(sampler, {"wrapS"}) == clamps ? " -clamp on " : " ") << one_line(image.uri) << '\n';
    }

    const json& document_;
    const std::string& stem_;
    std::vector<File>& images_;
    std::ostringstream text_;
    bool lost_mirrors_ = false;
};

// Names of all materials, no two the same.
std::vector<std::string> material_names(const json& document) {
    std::vector<std::string> names;
    std::set<std::string> taken;
    for (const json& material : gltf::array_of(document, "materials")) {
        const json& given = within(material, {"name"});
        std::string name = given.is_string() ? given.get<std::string>() : std::string();
        if (name.empty()) name = gltf::numbered("material", names.size());
        else if (taken.contains(name)) name += " (" + gltf::numbered("material", names.size()) + ")";
        names.push_back(name);
        taken.insert(std::move(name));
    }
    return names;
}

} // namespace

SourceDocument as_obj(SourceDocument document, const std::string& library, std::vector<Message>& notes) {
    if (document.format == SourceDocument::Format::obj) return document;
    const json source = gltf::parse_json(document.json);
    const std::vector<std::string> names = material_names(source);
    for (File& image : document.files)
        if (!image.uri.empty())
            if (const auto path = path_beside(decode_percent(image.uri))) image.uri = path->generic_string();
    MtlWriter writer(source, library, document.files);
    const std::string text = writer.write(names);
    if (writer.lost_mirrors())
        notes.push_back("OBJ knows no textures that are mirrored at their borders: they are repeated.");
    std::erase_if(document.files, [](const File& file) { return file.uri.empty(); }); // no material of OBJ names it
    if (!names.empty()) {
        document.files.push_back(
            {.use = File::Use::library, .uri = library + ".mtl", .bytes = std::make_shared<const std::string>(text)});
        notes.push_back("of materials, OBJ gets colour, opacity, metalness, roughness, light of their own and the "
                        "images of colour, "
                        "normals and light; nodes become objects in one frame; all else is left out.");
    }
    for_each_normal(document, [](const glm::dvec3& n, const Part& part) {
        return normal_matrix_of(glm::dmat3(part.to_world)).matrix * n;
    });
    for (Part& part : document.parts) {
        part.to_world = glm::dmat4(1);
        const json& mesh = at(source, "meshes", json(static_cast<std::size_t>(std::max(part.mesh, 0))));
        const json& node = at(source, "nodes", json(static_cast<std::size_t>(std::max(part.node, 0))));
        for (const json* named : {part.node >= 0 ? &node : &mesh, &mesh})
            if (const json& name = within(*named, {"name"}); part.object.empty() && name.is_string())
                part.object = name.get<std::string>();
        if (part.object.empty()) part.object = gltf::numbered("node", static_cast<std::size_t>(std::max(part.node, 0)));
        const json& primitives = within(mesh, {"primitives"});
        const auto primitive = static_cast<std::size_t>(std::max(part.primitive, 0));
        if (!primitives.is_array() || primitive >= primitives.size()) continue;
        const json& material = within(primitives[primitive], {"material"});
        if (material.is_number_unsigned() && material.get<std::size_t>() < names.size())
            part.material = names[material.get<std::size_t>()];
    }
    document.format = SourceDocument::Format::obj;
    turn_uvs_upside_down(document);
    return document;
}

} // namespace unseen::meshio
