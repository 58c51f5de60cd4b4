// glTF as exporters write it, and not as we do: vertices interleaved in one buffer view, indices of 16 bits, colours as
// normalised bytes, second coordinates as normalised shorts.
#pragma once

#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include <nlohmann/json.hpp>

#include "mesh_files.h"
#include "temp_folder.h"
#include "user_file.h"

namespace unseen::app::testing {

class ExportedGltf {
public:
    Json document = {{"asset", {{"version", "2.0"}, {"generator", "by hand"}}}, {"scene", 0}};

    struct Vertices {
        Json attributes; // numbers of accessors
        std::size_t indices = 0;
    };
    // What a primitive is made of. `uv`: from the patch's coordinates, v upward, to the file's; `colour`: none without.
    template <class Uv>
    Vertices add(const Patch& patch, Uv&& uv) {
        return add(patch, uv, NoColour{}, {});
    }
    template <class Uv, class Colour>
    Vertices add(const Patch& patch, Uv&& uv, Colour&& colour,
                 const std::vector<std::array<double, 2>>& second_uvs = {}) {
        using mesh_files::little;
        constexpr bool has_colours = !std::is_same_v<std::remove_cvref_t<Colour>, NoColour>;
        std::string vertices;
        std::vector<float> lo, hi; // of positions, which the format asks for
        for (std::size_t v = 0; v < patch.positions.size(); ++v) {
            for (const auto& triple : {patch.positions[v], patch.normals[v]})
                for (const double x : triple) vertices += little(static_cast<float>(x));
            for (const double x : uv(patch.uvs[v])) vertices += little(static_cast<float>(x));
            if constexpr (has_colours)
                for (const int code : colour(patch.uvs[v])) vertices += static_cast<char>(code);
            if (!second_uvs.empty())
                for (const double x : second_uvs[v])
                    vertices += little(static_cast<std::uint16_t>(std::lround(65535 * x)));
            for (std::size_t k = 0; k < 3; ++k) {
                const auto x = static_cast<float>(patch.positions[v][k]);
                if (v == 0) lo.push_back(x), hi.push_back(x);
                lo[k] = std::min(lo[k], x), hi[k] = std::max(hi[k], x);
            }
        }
        const std::size_t view = add_view(vertices), count = patch.positions.size();
        document["bufferViews"][view]["byteStride"] = vertices.size() / count;
        std::size_t offset = 0;
        const auto accessor = [&](const char* type, int component, std::size_t bytes, bool is_normalised) {
            Json made = {{"bufferView", view},
                         {"byteOffset", offset},
                         {"componentType", component},
                         {"count", count},
                         {"type", type}};
            if (is_normalised) made["normalized"] = true;
            offset += bytes;
            document["accessors"].push_back(std::move(made));
            return document["accessors"].size() - 1;
        };
        constexpr int bytes = 5121, shorts = 5123, floats = 5126;
        Vertices out;
        out.attributes["POSITION"] = accessor("VEC3", floats, 12, false);
        document["accessors"].back()["min"] = lo;
        document["accessors"].back()["max"] = hi;
        out.attributes["NORMAL"] = accessor("VEC3", floats, 12, false);
        out.attributes["TEXCOORD_0"] = accessor("VEC2", floats, 8, false);
        if (has_colours) out.attributes["COLOR_0"] = accessor("VEC4", bytes, 4, true);
        if (!second_uvs.empty()) out.attributes["TEXCOORD_1"] = accessor("VEC2", shorts, 4, true);
        out.indices = add_indices(patch.triangles);
        return out;
    }

    std::size_t add_indices(const std::vector<std::array<int, 3>>& triangles) {
        std::string bytes;
        for (const auto& triangle : triangles)
            for (const int corner : triangle) bytes += mesh_files::little(static_cast<std::uint16_t>(corner));
        document["accessors"].push_back({{"bufferView", add_view(bytes)},
                                         {"componentType", 5123},
                                         {"count", 3 * triangles.size()},
                                         {"type", "SCALAR"}});
        return document["accessors"].size() - 1;
    }

    void add_image(const std::string& png) {
        document["images"].push_back({{"bufferView", add_view(png)}, {"mimeType", "image/png"}});
    }

    std::string glb() const {
        Json whole = document;
        whole["buffers"] = {{{"byteLength", data_.size()}}};
        return mesh_files::glb(whole.dump(), data_);
    }
    // NAME.gltf and NAME.bin.
    void write(const fs::path& file) const {
        Json whole = document;
        const fs::path data = fs::path(file).replace_extension(".bin");
        whole["buffers"] = {{{"byteLength", data_.size()}, {"uri", data.filename().string()}}};
        fs::create_directories(file.parent_path());
        write_text(data, data_);
        write_text(file, whole.dump(2));
    }

private:
    struct NoColour {
        std::array<int, 4> operator()(std::array<double, 2>) const { return {}; }
    };

    std::size_t add_view(const std::string& bytes) {
        document["bufferViews"].push_back({{"buffer", 0}, {"byteOffset", data_.size()}, {"byteLength", bytes.size()}});
        data_ += bytes;
        data_.resize((data_.size() + 3) / 4 * 4, '\0');
        return document["bufferViews"].size() - 1;
    }

    std::string data_;
};

inline Json primitive(const ExportedGltf::Vertices& vertices, int material) {
    return {{"attributes", vertices.attributes}, {"indices", vertices.indices}, {"material", material}};
}

} // namespace unseen::app::testing
