// VTK's polygons in its XML format: VTK File Formats, https://docs.vtk.org, "XML File Formats".
#include <set>

#include <unseen/vdtree/colour.h>

#include "kept_arrays.h"
#include "mesh_readers.h"
#include "mesh_writers.h"
#include "value_types.h"
#include "vtp_data.h"

namespace unseen::meshio {

namespace {

// What stands in a file's point data, and under which names.
struct VtkPointData {
    std::vector<const VertexArray*> values;
    std::string normals = "Normals", colours, uvs = "TCoords"; // empty: there are none
    std::uint32_t colour_components = 3;                       // 4: with alpha
};

VtkPointData point_data_of(const MeshView& mesh, std::span<const VertexArray> arrays) {
    using Role = VertexArray::Role;
    VtkPointData data;
    std::set<std::string> used;
    for (const VertexArray& array : arrays) {
        if (array.role == Role::value) data.values.push_back(&array), used.insert(array.name);
        if (array.role == Role::normals) data.normals = array.name;
        if (array.role == Role::uvs) data.uvs = array.name;
        if (array.role == Role::colours) data.colours = array.name, data.colour_components = array.components;
    }
    const bool has_alpha =
        std::any_of(mesh.colours.begin(), mesh.colours.end(), [](glm::vec4 c) { return to_byte(c.a) < 255; });
    if (has_alpha || data.colour_components != 3) data.colour_components = 4;
    if (data.colours.empty()) data.colours = has_alpha ? "RGBA" : "RGB";
    const auto settle = [&](std::string& name, bool is_there) {
        if (!is_there) return name.clear();
        while (!used.insert(name).second) name += '_';
    };
    settle(data.normals, !mesh.normals.empty());
    settle(data.colours, !mesh.colours.empty());
    settle(data.uvs, !mesh.uvs.empty());
    return data;
}

std::string xml_text(std::string_view text) {
    std::string escaped;
    for (const char c : text)
        if (c == '&') escaped += "&amp;";
        else if (c == '<') escaped += "&lt;";
        else if (c == '>') escaped += "&gt;";
        else if (c == '"') escaped += "&quot;";
        else escaped += static_cast<unsigned char>(c) < 0x20 ? '_' : c; // XML has no place for these
    return escaped;
}

// Collects what stands behind the XML, for it begins with where everything lies.
class VtpWriter {
public:
    VtpWriter(FileOutput& out, const MeshView& mesh) : out_(out), mesh_(mesh) {}

    void write(const VtkPointData& data) {
        const std::string point_data = describe(data);
        const bool has_floats = are_floats(mesh_);
        const auto vertices = mesh_.positions.size(), triangles = mesh_.triangles.size();
        const ValueType index =
            3 * triangles > static_cast<std::size_t>(INT32_MAX) || vertices > static_cast<std::size_t>(INT32_MAX)
                ? ValueType::int64
                : ValueType::int32;
        const std::string points = array(has_floats ? ValueType::float32 : ValueType::float64, "Points", 3, vertices,
                                         [=, this] { put_positions(has_floats); });
        const std::string corners = array(index, "connectivity", 1, 3 * triangles, [=, this] {
            for (const Triangle& triangle : mesh_.triangles)
                for (const Index corner : triangle) put_index(corner, index);
        });
        const std::string ends = array(index, "offsets", 1, triangles, [=, this] {
            for (std::size_t t = 1; t <= triangles; ++t) put_index(3 * t, index);
        });
        out_.text(text_of(
            "<?xml version=\"1.0\"?>\n"
            "<VTKFile type=\"PolyData\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\">\n"
            "  <PolyData>\n    <Piece NumberOfPoints=\"",
            vertices, "\" NumberOfVerts=\"0\" NumberOfLines=\"0\" NumberOfStrips=\"0\" NumberOfPolys=\"", triangles,
            "\">\n", point_data, "      <Points>\n", points, "      </Points>\n      <Polys>\n", corners, ends,
            "      </Polys>\n    </Piece>\n  </PolyData>\n  <AppendedData encoding=\"raw\">\n   _"));
        for (const Block& block : blocks_) {
            out_.binary(block.bytes);
            block.write();
        }
        out_.text("\n  </AppendedData>\n</VTKFile>\n");
    }

private:
    struct Block {
        std::uint64_t bytes;
        std::function<void()> write;
    };

    std::string describe(const VtkPointData& data) {
        // Colours of an unusual name are known as such by being the scalars.
        std::string scalars = data.colours;
        if (!data.values.empty() && (scalars.empty() || is_colour_name(scalars))) scalars = data.values.front()->name;
        std::string xml = "      <PointData";
        for (const auto& [what, name] :
             {std::pair("Scalars", scalars), std::pair("Normals", data.normals), std::pair("TCoords", data.uvs)})
            if (!name.empty()) xml += std::string(" ") + what + "=\"" + xml_text(name) + "\"";
        xml += ">\n";
        for (const VertexArray* values : data.values)
            xml += array(values->type, values->name, values->components, values->size(), [=, this] { put(*values); });
        const std::size_t vertices = mesh_.positions.size();
        if (!data.normals.empty())
            xml += array(ValueType::float32, data.normals, 3, vertices, [this] { put_all(mesh_.normals); });
        if (!data.colours.empty())
            xml += array(ValueType::uint8, data.colours, data.colour_components, vertices,
                         [this, k = data.colour_components] { put_colours(k); });
        if (!data.uvs.empty()) xml += array(ValueType::float32, data.uvs, 2, vertices, [this] { put_all(mesh_.uvs); });
        return xml + "      </PointData>\n";
    }

    std::string array(ValueType type, const std::string& name, std::uint32_t components, std::size_t tuples,
                      std::function<void()> write) {
        const std::string xml =
            text_of("        <DataArray type=\"", vtp_name(type), "\" Name=\"", xml_text(name),
                    "\" NumberOfComponents=\"", components, "\" format=\"appended\" offset=\"", offset_, "\"/>\n");
        blocks_.push_back({tuples * components * byte_size(type), std::move(write)});
        offset_ += sizeof(std::uint64_t) + blocks_.back().bytes;
        return xml;
    }

    void put_index(std::uint64_t value, ValueType type) {
        if (type == ValueType::int64) out_.binary(static_cast<std::int64_t>(value));
        else out_.binary(static_cast<std::int32_t>(value));
    }
    void put(const VertexArray& array) {
        out_.text({reinterpret_cast<const char*>(array.values.data()), array.values.size()});
    }
    void put_all(const auto& vectors) {
        for (const auto& vector : vectors) out_.binary(vector);
    }
    void put_positions(bool has_floats) {
        if (!has_floats) return put_all(mesh_.positions);
        for (const glm::dvec3& p : mesh_.positions) out_.binary(glm::vec3(p));
    }
    void put_colours(std::uint32_t components) {
        for (const glm::vec4& colour : mesh_.colours) {
            const auto bytes = encoded_bytes(colour);
            out_.text({reinterpret_cast<const char*>(bytes.data()), components});
        }
    }

    FileOutput& out_;
    const MeshView& mesh_;
    std::vector<Block> blocks_;
    std::uint64_t offset_ = 0; // of the next block
};

} // namespace

Result<void> write_vtp(const MeshToWrite& to) {
    return write_file(to.file,
                      [&](FileOutput& out) { VtpWriter(out, to.mesh).write(point_data_of(to.mesh, to.arrays)); });
}

} // namespace unseen::meshio
