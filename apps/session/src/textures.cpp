#include "textures.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <span>
#include <tuple>

#include <unseen/vdtree/colour.h>
#include <unseen/vdtree/internal/budget.h>
#include <unseen/vdtree/internal/names.h>
#include <unseen/vdtree/internal/texture_pyramid.h>

#include "texture_image.h"

namespace unseen::session {
namespace {

using meshio::Material;
using vdtree::Index;
using vdtree::Mesh;
using vdtree::MeshRange;
using vdtree::Texture;

constexpr std::size_t no_material = std::numeric_limits<std::size_t>::max(), unused = no_material - 1;

// ---- several textures in one: trees have one texture each

// One of the textures, and the coordinates at which it is looked up.
struct AtlasPart {
    std::string name;               // for messages
    const vdtree::Texture* texture; // the caller's; must outlive the call of make_atlas()
    vdtree::UvBox used;
};

// Where a part is in the atlas: coordinates there are scale * uv + offset.
struct AtlasPlace {
    glm::dvec2 scale = glm::dvec2(0), offset = glm::dvec2(0);
};

struct Atlas {
    vdtree::Texture texture;
    std::vector<AtlasPlace> places; // by part
};

// Of maps that a part lacks.
constexpr vdtree::Texel dark{0, 0, 0, 255}, flat{128, 128, 255, 255};

// Texels around a part: mip levels up to the fourth do not reach across.
constexpr std::int64_t border = 16;

// What repeats grows: texels of the atlas for each of the images', and texels in any case.
constexpr std::int64_t most_growth = 64, small_atlas = std::int64_t{1} << 24;

// The part as it is laid: whole copies of its texture, from the copy `first` on.
struct Tile {
    std::size_t part = 0;
    std::int64_t first_u = 0, first_v = 0, copies_u = 1, copies_v = 1;
    std::int64_t width = 0, height = 0; // texels, without borders
    std::int64_t x = 0, y = 0;          // of the first texel in the atlas
};

Error too_large(const AtlasPart& part) {
    return {ErrorCode::unsupported, "The texture of " + part.name + " is repeated from " +
                                        std::to_string(part.used.lo.x) + ", " + std::to_string(part.used.lo.y) +
                                        " to " + std::to_string(part.used.hi.x) + ", " +
                                        std::to_string(part.used.hi.y) +
                                        ": laid beside the others that takes too many texels; scale the images down, "
                                        "or give the mesh one image for all."};
}

Result<Tile> tile_of(const AtlasPart& part, std::size_t number) {
    Tile tile;
    tile.part = number;
    const std::int64_t sizes[] = {part.texture->width, part.texture->height};
    for (int k = 0; k < 2; ++k) {
        const double lo = part.used.is_empty() ? 0 : std::floor(static_cast<double>(part.used.lo[k]));
        const double hi = part.used.is_empty() ? 1 : std::max(std::ceil(static_cast<double>(part.used.hi[k])), lo + 1);
        if (!((hi - lo) * static_cast<double>(sizes[k]) + 2 * border <= vdtree::largest_texture_side) ||
            !(std::abs(lo) < 1e9))
            return too_large(part);
        (k == 0 ? tile.first_u : tile.first_v) = static_cast<std::int64_t>(lo);
        (k == 0 ? tile.copies_u : tile.copies_v) = static_cast<std::int64_t>(hi - lo);
    }
    tile.width = tile.copies_u * sizes[0];
    tile.height = tile.copies_v * sizes[1];
    return tile;
}

// In rows, the highest tiles first. The height that they take.
std::int64_t place_in_rows(std::vector<Tile>& tiles, std::int64_t width) {
    std::int64_t x = 0, y = 0, row = 0;
    for (Tile& tile : tiles) {
        if (x + tile.width + 2 * border > width) x = 0, y += row, row = 0;
        tile.x = x + border;
        tile.y = y + border;
        x += tile.width + 2 * border;
        row = std::max(row, tile.height + 2 * border);
    }
    return y + row;
}

void lay(const Tile& tile, const Texture& from, Texture& to) {
    for (std::int64_t y = -border; y < tile.height + border; ++y) {
        const std::int64_t row = vdtree::wrapped_texel(y + tile.first_v * from.height, from.height, from.wrap_v);
        for (std::int64_t x = -border; x < tile.width + border; ++x) {
            const std::int64_t column = vdtree::wrapped_texel(x + tile.first_u * from.width, from.width, from.wrap_u);
            const auto place = static_cast<std::size_t>((tile.y + y) * to.width + tile.x + x),
                       texel = static_cast<std::size_t>(row * from.width + column);
            to.texels[place] = from.texels[texel];
            if (to.blends && !from.blends) to.texels[place][3] = from.texels[texel][3] >= 128 ? 255 : 0;
            if (!from.emission.empty()) to.emission[place] = from.emission[texel];
            if (!from.relief.empty()) to.relief[place] = from.relief[texel];
        }
    }
}

// Puts parts side by side, each as often as its coordinates repeat it, with borders that go on as the part does, so
// that filters do not mix neighbours. Fails where that is larger than a texture may be.
Result<Atlas> make_atlas(std::span<const AtlasPart> parts) {
    std::vector<Tile> tiles;
    std::int64_t area = 0, widest = 1, of_images = 0;
    for (std::size_t i = 0; i < parts.size(); ++i) {
        auto tile = tile_of(parts[i], i);
        if (!tile) return tile.error();
        area += (tile->width + 2 * border) * (tile->height + 2 * border);
        widest = std::max(widest, tile->width + 2 * border);
        of_images += std::int64_t{parts[i].texture->width} * parts[i].texture->height;
        tiles.push_back(*tile);
    }
    std::stable_sort(tiles.begin(), tiles.end(), [](const Tile& a, const Tile& b) { return a.height > b.height; });
    if (area > std::max(small_atlas, most_growth * of_images)) return too_large(parts[tiles.front().part]);
    const auto square = static_cast<std::int64_t>(std::ceil(std::sqrt(static_cast<double>(area))));
    std::int64_t width = std::max(widest, square), height = place_in_rows(tiles, width);
    if (height > vdtree::largest_texture_side) {
        width = vdtree::largest_texture_side;
        height = place_in_rows(tiles, width);
    }
    if (std::max(width, height) > vdtree::largest_texture_side) return too_large(parts[tiles.front().part]);

    Atlas atlas;
    atlas.texture.width = static_cast<std::uint32_t>(width);
    atlas.texture.height = static_cast<std::uint32_t>(height);
    atlas.texture.wrap_u = atlas.texture.wrap_v = vdtree::Wrap::clamp;
    const auto texels = static_cast<std::size_t>(width * height);
    atlas.texture.texels.resize(texels, vdtree::Texel{255, 255, 255, 255});
    const auto any = [&](auto&& holds) {
        return std::ranges::any_of(parts, [&](const AtlasPart& part) { return holds(*part.texture); });
    };
    atlas.texture.blends = any([](const Texture& t) { return t.blends; });
    if (any([](const Texture& t) { return !t.emission.empty(); })) atlas.texture.emission.resize(texels, dark);
    if (any([](const Texture& t) { return !t.relief.empty(); })) atlas.texture.relief.resize(texels, flat);
    atlas.places.resize(parts.size());
    for (const Tile& tile : tiles) {
        const Texture& from = *parts[tile.part].texture;
        lay(tile, from, atlas.texture);
        const glm::dvec2 size(static_cast<double>(width), static_cast<double>(height)), own(from.width, from.height);
        const glm::dvec2 first(static_cast<double>(tile.first_u), static_cast<double>(tile.first_v)),
            at(static_cast<double>(tile.x), static_cast<double>(tile.y));
        atlas.places[tile.part] = {own / size, (at - first * own) / size};
    }
    return atlas;
}

// ---- materials

// What two materials have alike if one texture does for both.
using Maps = std::tuple<const std::string*, const std::string*, const std::string*, const std::string*, vdtree::Wrap,
                        vdtree::Wrap, std::optional<float>, float, float, std::array<float, 3>>;
Maps maps_of(const Material& m) {
    return {m.image_bytes.get(),
            m.normal_map.get(),
            m.emission_map.get(),
            m.opacity_map.get(),
            m.wrap_u,
            m.wrap_v,
            m.alpha_cutoff,
            m.blends ? m.colour.a : 2.0f,
            m.normal_scale,
            {m.emission.r, m.emission.g, m.emission.b}};
}

// By triangle: the number of its material, or of the first one that looks the same.
std::vector<std::size_t> materials_of_triangles(const meshio::ReadResult& read) {
    using Look = std::tuple<Maps, std::array<float, 4>, std::array<double, 6>>;
    std::map<Look, std::size_t> first;
    std::map<std::string, std::size_t> numbers;
    for (std::size_t i = 0; i < read.materials.size(); ++i) {
        const meshio::Material& m = read.materials[i];
        const glm::dmat2& uv = m.uv_map.linear;
        const Look look{maps_of(m),
                        {m.colour.r, m.colour.g, m.colour.b, m.colour.a},
                        {uv[0][0], uv[0][1], uv[1][0], uv[1][1], m.uv_map.offset.x, m.uv_map.offset.y}};
        numbers.emplace(m.name, first.try_emplace(look, i).first->second);
    }
    std::vector<std::size_t> of(read.mesh.triangles.size(), no_material);
    for (const MeshRange& range : read.mesh.ranges) {
        const auto found = numbers.find(range.name);
        if (range.kind != MeshRange::Kind::material || found == numbers.end()) continue;
        std::fill_n(of.begin() + static_cast<std::ptrdiff_t>(range.first_triangle), range.triangle_count,
                    found->second);
    }
    return of;
}

// Gives every vertex one material: those that several use are doubled.
std::vector<std::size_t> part_vertices(meshio::ReadResult& read, const std::vector<std::size_t>& of_triangle) {
    Mesh& mesh = read.mesh;
    const auto repeat = [](auto& values, std::size_t which, std::size_t count = 1) {
        if (values.empty()) return;
        for (std::size_t i = 0; i < count; ++i)
            values.push_back(typename std::remove_cvref_t<decltype(values)>::value_type(values[which * count + i]));
    };
    std::vector<std::size_t> of_vertex(mesh.positions.size(), unused);
    std::map<std::pair<Index, std::size_t>, Index> doubled;
    for (std::size_t t = 0; t < mesh.triangles.size(); ++t) {
        for (Index& v : mesh.triangles[t]) {
            if (of_vertex[v] == unused) of_vertex[v] = of_triangle[t];
            if (of_vertex[v] == of_triangle[t]) continue;
            const auto [entry, is_new] =
                doubled.try_emplace({v, of_triangle[t]}, static_cast<Index>(mesh.positions.size()));
            if (is_new) {
                of_vertex.push_back(of_triangle[t]);
                repeat(mesh.positions, v);
                repeat(mesh.uvs, v);
                repeat(mesh.normals, v);
                repeat(mesh.colours, v);
                if (read.document)
                    for (auto& channel : read.document->channels) repeat(channel.values, v, channel.components);
            }
            v = entry->second;
        }
    }
    return of_vertex;
}

// Stretches alpha so that texels are there from a half on (vdtree::coverage()), and the outline between two lies where it
// did. Without a cut-off all are there.
void cut_out(Texture& texture, std::optional<float> cutoff) {
    std::array<std::uint8_t, 256> stretched{};
    for (std::size_t code = 0; code < stretched.size(); ++code) {
        const double alpha = static_cast<double>(code) / 255, least = static_cast<double>(cutoff.value_or(0));
        const double above = least < 1 ? (alpha - least) / (1 - least) : 1;
        stretched[code] = static_cast<std::uint8_t>(!(least > 0)     ? 255
                                                    : alpha >= least ? 128 + std::lround(127 * above)
                                                                     : std::lround(127 * alpha / least));
    }
    for (vdtree::Texel& texel : texture.texels) texel[3] = stretched[texel[3]];
}

// `opacity`: a map of as many texels, or empty.
void set_alpha(Texture& texture, const Material& material, std::span<const vdtree::Texel> opacity) {
    if (!material.blends && opacity.empty()) return cut_out(texture, material.alpha_cutoff);
    const auto is_whole = [](vdtree::Texel texel) { return texel[3] == 255; };
    const bool by_alpha = !std::ranges::all_of(opacity, is_whole);
    for (std::size_t i = 0; i < texture.texels.size(); ++i) {
        std::uint8_t& alpha = texture.texels[i][3];
        if (!opacity.empty()) {
            const vdtree::Texel& of = opacity[i];
            alpha = by_alpha
                        ? of[3]
                        : static_cast<std::uint8_t>(std::lround(rec709_luminance(glm::dvec3(of[0], of[1], of[2]))));
        }
        alpha = static_cast<std::uint8_t>(std::lround(static_cast<float>(alpha) * material.colour.a));
    }
    texture.blends = !std::ranges::all_of(texture.texels, is_whole);
}

// Scales x and y of the normals, and turns y around where the image's rows run downward: green is up.
void scale_relief(std::vector<vdtree::Texel>& relief, float scale, bool from_top) {
    for (vdtree::Texel& texel : relief) {
        glm::vec3 normal = vdtree::relief_normal(texel) * glm::vec3(scale, from_top ? -scale : scale, 1);
        const float length = glm::length(normal);
        normal = length > 0 && std::isfinite(length) ? normal / length : glm::vec3(0, 0, 1);
        for (int k = 0; k < 3; ++k)
            texel[static_cast<std::size_t>(k)] = static_cast<std::uint8_t>(std::lround(128 + 127 * normal[k]));
        texel[3] = 255;
    }
}

// Times the factor. True if some of it is brighter than white, and was cut off there.
bool scale_light(std::vector<vdtree::Texel>& texels, glm::vec3 factor) {
    bool is_too_bright = false;
    for (vdtree::Texel& texel : texels) {
        const glm::vec3 light = glm::vec3(vdtree::linear_colour(texel)) * factor;
        for (int k = 0; k < 3; ++k) {
            is_too_bright = is_too_bright || light[k] > 1;
            texel[static_cast<std::size_t>(k)] =
                static_cast<std::uint8_t>(std::lround(255 * linear_to_srgb(std::min(light[k], 1.0f))));
        }
    }
    return is_too_bright;
}

// The textures of materials, each made once of images that are each decoded once.
class Textures {
public:
    explicit Textures(bool from_top) : from_top_(from_top) {}

    // Its image's colours are multiplied by `tint`. Null: nothing of it could be decoded.
    const Texture* of(const Material& material, glm::vec3 tint) {
        auto [entry, is_new] = textures_.try_emplace({maps_of(material), {tint.r, tint.g, tint.b}});
        if (is_new) entry->second = make(material, tint);
        return entry->second ? &*entry->second : nullptr;
    }

    // Whether an image of it could not be decoded.
    bool lacks_images(const Material& material) {
        for (const auto& bytes :
             {material.image_bytes, material.normal_map, material.emission_map, material.opacity_map})
            if (bytes && !image_of(bytes, material)) return true;
        return false;
    }

    // Sentences on the images that could not be decoded, the triangles that are drawn without, and light beyond white.
    void warn(std::uint64_t triangles, std::vector<Message>& warnings) const {
        if (is_too_bright_)
            warnings.push_back(
                "what shines brighter than white is drawn white, which is the brightest that displays show.");
        if (complaints_.empty()) return;
        std::string first = complaints_.front();
        if (first.ends_with('.')) first.pop_back();
        const std::string count = complaints_.size() == 1 ? "" : "the first of " + std::to_string(complaints_.size());
        warnings.push_back(
            Message::of("{} drawn without an image of the material, which could not be decoded ({}{}); "
                        "{load.texture} names another image.",
                        {std::to_string(triangles) + (triangles == 1 ? " triangle is" : " triangles are"),
                         count.empty() ? "" : count + ": ", first}));
    }

private:
    // Null: there is none, or it could not be decoded.
    const Texture* image_of(const std::shared_ptr<const std::string>& bytes, const Material& material) {
        if (!bytes) return nullptr;
        auto [entry, is_new] = images_.try_emplace(bytes.get());
        std::optional<Texture>& image = entry->second;
        if (!is_new) return image ? &*image : nullptr;
        const std::string name = bytes == material.image_bytes && !material.image.empty()
                                     ? material.image.generic_string()
                                     : (bytes == material.image_bytes ? "the image" : "a map") +
                                           std::string(" of material '") + material.name + "'";
        auto decoded = decode_texture(*bytes, name, from_top_);
        if (!decoded) complaints_.push_back(decoded.error().message);
        else if (spends(decoded->texels.size(), name)) image = std::move(*decoded);
        return image ? &*image : nullptr;
    }

    bool spends(std::uint64_t texels, const std::string& name) {
        if (texels_.spend(texels)) return true;
        complaints_.push_back(name + ": with it the images have more than 2^29 pixels in all; scale it down.");
        return false;
    }

    // As large as the largest of its images: others are interpolated.
    std::optional<Texture> make(const Material& material, glm::vec3 tint) {
        const Texture *const colour = image_of(material.image_bytes, material),
                             *const normals = image_of(material.normal_map, material),
                             *const light = image_of(material.emission_map, material),
                             *const opacity = image_of(material.opacity_map, material);
        const bool shines = material.shines() && (light || !material.emission_map);
        if (!colour && !normals && !opacity && !shines && !material.blends && tint == glm::vec3(1)) return std::nullopt;
        Texture made{1, 1, material.wrap_u, material.wrap_v, {}};
        for (const Texture* image : {colour, normals, light, opacity}) {
            if (!image) continue;
            made.width = std::max(made.width, image->width);
            made.height = std::max(made.height, image->height);
        }
        const std::uint64_t texels = std::uint64_t{made.width} * made.height;
        if (!made_texels_.spend(texels)) {
            complaints_.push_back(
                "the maps of material '" + material.name +
                "', as large as its largest one, have with others more than 2^29 pixels in all; scale "
                "them down.");
            return std::nullopt;
        }
        constexpr vdtree::Texel white{255, 255, 255, 255};
        const auto fitted = [&](const Texture* image) {
            return image ? resized(*image, made) : std::vector<vdtree::Texel>(texels, white);
        };
        made.texels = fitted(colour);
        if (tint != glm::vec3(1)) scale_light(made.texels, tint);
        set_alpha(made, material, opacity ? fitted(opacity) : std::vector<vdtree::Texel>());
        if (normals) {
            made.relief = fitted(normals);
            scale_relief(made.relief, material.normal_scale, from_top_);
        }
        if (shines) {
            made.emission = fitted(light);
            is_too_bright_ = scale_light(made.emission, material.emission) || is_too_bright_;
        }
        return made;
    }

    // Interpolated between texels' middles, code by code.
    static std::vector<vdtree::Texel> resized(const Texture& image, const Texture& to) {
        if (image.width == to.width && image.height == to.height) return image.texels;
        std::vector<vdtree::Texel> texels;
        texels.reserve(std::size_t{to.width} * to.height);
        const auto at = [&](std::int64_t x, std::int64_t y) -> const vdtree::Texel& {
            return image
                .texels[static_cast<std::size_t>(vdtree::wrapped_texel(y, image.height, to.wrap_v) * image.width +
                                                 vdtree::wrapped_texel(x, image.width, to.wrap_u))];
        };
        for (std::uint32_t row = 0; row < to.height; ++row)
            for (std::uint32_t column = 0; column < to.width; ++column) {
                const double x = (column + 0.5) * image.width / to.width - 0.5,
                             y = (row + 0.5) * image.height / to.height - 0.5;
                const auto left = static_cast<std::int64_t>(std::floor(x)),
                           above = static_cast<std::int64_t>(std::floor(y));
                const double s = x - std::floor(x), t = y - std::floor(y);
                vdtree::Texel& texel = texels.emplace_back();
                for (std::size_t k = 0; k < texel.size(); ++k)
                    texel[k] = static_cast<std::uint8_t>(
                        std::lround((1 - t) * ((1 - s) * at(left, above)[k] + s * at(left + 1, above)[k]) +
                                    t * ((1 - s) * at(left, above + 1)[k] + s * at(left + 1, above + 1)[k])));
            }
        return texels;
    }

    bool from_top_, is_too_bright_ = false;
    static constexpr std::uint64_t most_texels = std::uint64_t{1} << 29; // of all images, and of all textures
    Budget texels_{0, 0, most_texels}, made_texels_{0, 0, most_texels};
    std::map<const std::string*, std::optional<Texture>> images_;
    std::map<std::pair<Maps, std::array<float, 3>>, std::optional<Texture>> textures_;
    std::vector<std::string> complaints_;
};

// The reflectance of a vertex: its own colour times its material's, and the texture's where it has one. Each is white
// where nothing is said; a mesh of which nothing is said stays without colours.
void colour_vertices(Mesh& mesh, const std::vector<Material>& materials, const std::vector<std::size_t>& of_vertex) {
    if (mesh.colours.empty()) mesh.colours.assign(mesh.positions.size(), glm::vec4(1));
    for (std::size_t v = 0; v < of_vertex.size(); ++v)
        if (of_vertex[v] < materials.size()) mesh.colours[v] *= materials[of_vertex[v]].colour;
}

Result<void> lay_one(const std::filesystem::path& mesh_file, meshio::ReadResult& read,
                     const std::filesystem::path& image) {
    if (read.mesh.uvs.empty())
        return Error{ErrorCode::malformed_data,
                     Message::of("{}: it has no texture coordinates, which say where the image of {load.texture} lies; "
                                 "leave it out.",
                                 {mesh_file.string()})};
    auto texture = read_texture(image, read.uvs_from_top);
    if (!texture) return texture.error();
    cut_out(*texture, std::nullopt);
    read.mesh.texture = std::move(*texture);
    return {};
}

// Says how the vertices of each part are drawn. `uv_maps`: by material, the last of triangles without one.
void note_drawing(meshio::ReadResult& read, const std::vector<std::size_t>& of_triangle,
                  const std::vector<meshio::UvMap>& uv_maps) {
    if (!read.document) return;
    for (const auto& run : read.document->runs) {
        const std::size_t material = std::min(of_triangle[run.first_triangle], read.materials.size());
        read.document->parts[run.part].drawn_uv = uv_maps[material];
        if (material < read.materials.size()) read.document->parts[run.part].colour = read.materials[material].colour;
    }
}

// Lays the images of materials over the mesh, side by side. Materials without an image, and triangles without a
// material, get a white one. Returns by material how its coordinates are drawn, the last of those without one.
Result<std::vector<meshio::UvMap>> lay_images(const std::filesystem::path& mesh_file, meshio::ReadResult& read,
                                              const std::vector<std::size_t>& of_triangle,
                                              const std::vector<std::size_t>& of_vertex,
                                              const std::vector<glm::vec3>& tints) {
    Mesh& mesh = read.mesh;
    const auto has_maps = [&](std::size_t m) { return m != no_material && read.materials[m].has_maps(); };
    Textures textures(read.uvs_from_top);
    static const Texture white{1, 1, vdtree::Wrap::clamp, vdtree::Wrap::clamp, {{255, 255, 255, 255}}};
    std::vector<const Texture*> of_material(read.materials.size() + 1, &white); // the last: no material
    std::vector<std::uint64_t> triangles(read.materials.size());
    for (const std::size_t m : of_triangle)
        if (has_maps(m)) ++triangles[m];
    std::uint64_t lost = 0;
    for (std::size_t m = 0; m < triangles.size(); ++m) {
        if (triangles[m] == 0) continue;
        if (const Texture* texture = textures.of(read.materials[m], tints[m])) of_material[m] = texture;
        if (textures.lacks_images(read.materials[m])) lost += triangles[m];
    }
    textures.warn(lost, read.warnings);
    if (std::all_of(of_material.begin(), of_material.end(), [](const Texture* image) { return image == &white; }))
        return std::vector<meshio::UvMap>(of_material.size());
    constexpr meshio::UvMap middle{glm::dmat2(0), glm::dvec2(0.5)};
    std::vector<meshio::UvMap> maps(of_material.size(), middle);
    for (std::size_t m = 0; m < read.materials.size(); ++m)
        if (const Texture* of = of_material[m]; of->width > 1 || of->height > 1 || !of->relief.empty())
            maps[m] = read.materials[m].uv_map; // else it is alike everywhere

    std::vector<AtlasPart> parts;
    std::map<const Texture*, std::size_t> part_of;
    std::vector<std::size_t> part_of_material(of_material.size(), 0);
    for (std::size_t v = 0; v < of_vertex.size(); ++v) {
        if (of_vertex[v] == unused) continue;
        const std::size_t m = std::min(of_vertex[v], read.materials.size());
        const auto [entry, is_new] = part_of.try_emplace(of_material[m], parts.size());
        if (is_new)
            parts.push_back(
                {m < read.materials.size() ? "material " + in_quotes(read.materials[m].name) : "no material",
                 of_material[m],
                 {}});
        part_of_material[m] = entry->second;
        mesh.uvs[v] = glm::vec2(maps[m](mesh.uvs[v]));
        parts[entry->second].used.include(mesh.uvs[v]);
    }
    if (parts.size() == 1) {
        mesh.texture = *parts[0].texture;
        return maps;
    }
    auto atlas = make_atlas(parts);
    if (!atlas) return Error{atlas.error().code, mesh_file.string() + ": " + atlas.error().message};
    for (std::size_t v = 0; v < of_vertex.size(); ++v) { // those that are not used get some place, too
        const AtlasPlace& place = atlas->places[part_of_material[std::min(of_vertex[v], read.materials.size())]];
        mesh.uvs[v] = glm::vec2(place.scale * glm::dvec2(mesh.uvs[v]) + place.offset);
    }
    for (std::size_t m = 0; m < maps.size(); ++m) {
        const AtlasPlace& place = atlas->places[part_of_material[m]];
        for (int k = 0; k < 2; ++k) maps[m].linear[k] *= place.scale;
        maps[m].offset = place.scale * maps[m].offset + place.offset;
    }
    mesh.texture = std::move(atlas->texture);
    return maps;
}

Result<void> lay_materials(const std::filesystem::path& mesh_file, meshio::ReadResult& read, bool with_images) {
    const std::vector<std::size_t> of_triangle = materials_of_triangles(read);
    const auto any = [&](auto&& holds) {
        return std::any_of(of_triangle.begin(), of_triangle.end(),
                           [&](std::size_t m) { return m != no_material && holds(read.materials[m]); });
    };
    const bool has_images =
        with_images && !read.mesh.uvs.empty() && any([](const Material& m) { return m.has_maps(); });
    if (with_images && read.mesh.uvs.empty() && any([](const Material& m) { return m.shines() || m.is_glass(); }))
        read.warnings.push_back("without texture coordinates neither light that materials send out is drawn, nor what "
                                "shows through them: what is said of visibility does not know it.");
    // The colour of what shines goes into its texels: what darkens vertices darkens their light in measurements, too.
    std::vector<glm::vec3> tints(read.materials.size(), glm::vec3(1));
    for (std::size_t m = 0; has_images && m < tints.size(); ++m) {
        if (!read.materials[m].shines()) continue;
        glm::vec4& colour = read.materials[m].colour;
        tints[m] = glm::vec3(colour);
        colour = glm::vec4(1, 1, 1, colour.a);
    }
    const bool has_colours = any([](const Material& m) { return m.colour != glm::vec4(1); });
    if (!has_images && !has_colours) return {};
    const std::vector<std::size_t> of_vertex = part_vertices(read, of_triangle);
    if (has_colours) colour_vertices(read.mesh, read.materials, of_vertex);
    Result<std::vector<meshio::UvMap>> maps = std::vector<meshio::UvMap>(read.materials.size() + 1);
    if (has_images) maps = lay_images(mesh_file, read, of_triangle, of_vertex, tints);
    if (!maps) return maps.error();
    note_drawing(read, of_triangle, *maps);
    return {};
}

// Hands what else the file said over to the mesh.
void keep_document(meshio::ReadResult& read) {
    if (!read.document) return;
    meshio::SourceDocument& document = *read.document;
    if (document.format != meshio::SourceDocument::Format::table)
        document.vertex_parts.assign(read.mesh.positions.size(), 0);
    for (std::size_t i = 0; i < document.runs.size(); ++i) {
        const std::size_t end =
            i + 1 < document.runs.size() ? document.runs[i + 1].first_triangle : read.mesh.triangles.size();
        for (std::size_t t = document.runs[i].first_triangle; t < end; ++t)
            for (const Index v : read.mesh.triangles[t]) document.vertex_parts[v] = document.runs[i].part;
    }
    read.mesh.further = meshio::further_values(document);
    read.mesh.document = meshio::pack(document);
    read.document.reset();
}

} // namespace

bool names_folder(const LoadOptions& options) {
    std::error_code unknown;
    return std::filesystem::is_directory(options.texture, unknown);
}

meshio::ReadOptions reading_options(const LoadOptions& options, meshio::ReadOptions reading) {
    const bool is_folder = names_folder(options);
    reading.images = (options.texture.empty() || is_folder) && !options.without_textures;
    if (is_folder) reading.search_folder = options.texture;
    reading.drop = options.drop;
    reading.skip_bad = options.skip_bad;
    reading.weld = options.weld;
    return reading;
}

Result<void> lay_texture(const std::filesystem::path& mesh_file, meshio::ReadResult& read, const LoadOptions& options) {
    const bool has_own_image = !options.texture.empty() && !names_folder(options);
    if (const auto laid = lay_materials(mesh_file, read, !has_own_image && !options.without_textures); !laid)
        return laid;
    if (has_own_image)
        if (const auto laid = lay_one(mesh_file, read, options.texture); !laid) return laid;
    keep_document(read);
    return {};
}

} // namespace unseen::session
