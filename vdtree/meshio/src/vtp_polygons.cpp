#include "vtp_polygons.h"

#include <algorithm>
#include <cctype>
#include <limits>
#include <map>
#include <span>
#include <string_view>

#include "kept_arrays.h"
#include "value_types.h"

namespace unseen::meshio {

namespace {

bool is_same_kind(const VertexArray& a, const VertexArray& b) {
    return a.type == b.type && a.components == b.components;
}

bool is_named(const VertexArray& array, std::initializer_list<std::string_view> lower) {
    return std::any_of(lower.begin(), lower.end(), [&](std::string_view name) {
        return std::equal(array.name.begin(), array.name.end(), name.begin(), name.end(),
                          [](char a, char b) { return std::tolower(static_cast<unsigned char>(a)) == b; });
    });
}

// Of those that can be it: the one that is marked, else the first that is named so.
template <class CanBe, class IsNamed>
VertexArray* pick(std::vector<VertexArray>& arrays, const std::string& marked, CanBe&& can_be, IsNamed&& has_its_name) {
    for (VertexArray& array : arrays)
        if (!marked.empty() && array.name == marked && can_be(array)) return &array;
    for (VertexArray& array : arrays)
        if (has_its_name(array) && can_be(array)) return &array;
    return nullptr;
}

// The mesh has its values now.
void give_away(VertexArray& array, VertexArray::Role role) {
    array.role = role;
    array.values = {};
}

std::string counted(std::uint64_t count, const std::string& noun) {
    return std::to_string(count) + " " + noun + (count == 1 ? "" : "s");
}

} // namespace

Error error_of(const MeshSource& source, const VtkFault& fault) {
    if (fault.code == ErrorCode::cancelled) return cancelled(source);
    return {fault.code, source.name + ": " + fault.what};
}

void VtkPolygons::NameList::add(const std::vector<std::string>& more) {
    for (const std::string& name : more)
        if (known.insert(name).second) names.push_back(name);
}

void VtkPolygons::add(VtkPiece piece) {
    vertex_cells_ += piece.vertex_cells;
    lines_ += piece.lines;
    cell_arrays_.add(piece.cell_arrays);
    other_arrays_.add(piece.other_arrays);
    Mesh& mesh = result_.mesh;
    const std::size_t first = mesh.positions.size(), count = piece.points.size();
    if (count > std::numeric_limits<Index>::max() - first)
        throw VtkFault{"it has more points than 32-bit indices can number; split the mesh.", ErrorCode::unsupported};
    if (first == 0) mesh.positions.reserve(count); // later ones let it grow: there may be very many
    for (std::size_t i = 0; i < count; ++i) {
        mesh.positions.emplace_back(piece.points.number(i, 0), piece.points.number(i, 1), piece.points.number(i, 2));
        check_position(result_.bad, mesh.positions.back(), [&] { return piece.name + "point " + std::to_string(i); });
    }
    piece.points.values = {};
    if (count > 0) add_data(piece);
    const FaceVertices vertices{first, count};
    add_cells(piece, piece.polygons, vertices, false);
    add_cells(piece, piece.strips, vertices, true);
}

void VtkPolygons::add_cells(const VtkPiece& piece, const VtkCells& cells, const FaceVertices& vertices,
                            bool are_strips) {
    const std::span<const std::int64_t> corners = cells.corners;
    std::size_t begin = 0;
    for (std::size_t i = 0; i < cells.ends.size(); ++i) {
        if (i % rows_per_progress == 0 && !source_.keep_going(source_.bytes.size(), "reading VTK"))
            throw VtkFault{{}, ErrorCode::cancelled};
        const auto where = [&] { return piece.name + (are_strips ? "strip " : "polygon ") + std::to_string(i); };
        const std::int64_t end = cells.ends[i];
        if (end < static_cast<std::int64_t>(begin) || static_cast<std::uint64_t>(end) > corners.size())
            throw VtkFault{where() + " ends at corner " + std::to_string(end) + ", but it begins at " +
                           std::to_string(begin) + " and there are " + std::to_string(corners.size()) +
                           "; the file is damaged."};
        const auto of_cell = corners.subspan(begin, static_cast<std::size_t>(end) - begin);
        if (are_strips) faces_.add_strip(of_cell, vertices, false, where);
        else faces_.add_polygon(of_cell, vertices, where);
        begin = static_cast<std::size_t>(end);
    }
}

// Pieces are parts of one mesh: what one of them has not is no array of the whole.
void VtkPolygons::add_data(VtkPiece& piece) {
    if (!std::exchange(has_pieces_, true)) {
        data_ = std::move(piece.data);
        scalars_ = piece.scalars, normals_ = piece.normals, uvs_ = piece.uvs;
        return;
    }
    std::map<std::string_view, const VertexArray*> by_name;
    for (const VertexArray& array : piece.data) by_name.try_emplace(array.name, &array);
    std::erase_if(data_, [&](VertexArray& array) {
        const auto found = by_name.find(array.name);
        const bool is_there = found != by_name.end() && is_same_kind(array, *found->second);
        if (is_there) {
            const auto& more = found->second->values;
            array.values.insert(array.values.end(), more.begin(), more.end());
            by_name.erase(found);
        } else partial_arrays_.add({array.name});
        return !is_there;
    });
    for (const auto& rest : by_name) partial_arrays_.add({std::string(rest.first)});
}

void VtkPolygons::give_roles() {
    const auto is_real = [](const VertexArray& a) { return !is_integer(a.type); };
    if (VertexArray* normals = pick(
            data_, normals_, [&](const VertexArray& a) { return is_real(a) && a.components == 3; },
            [](const VertexArray& a) { return is_named(a, {"normals"}); }))
        take_normals(*normals);
    if (VertexArray* uvs = pick(
            data_, uvs_, [&](const VertexArray& a) { return is_real(a) && a.components == 2; },
            [](const VertexArray& a) {
                return is_named(a, {"tcoords", "texture coordinates"});
            }))
        take_uvs(*uvs);
    const auto can_be_colour = [](const VertexArray& a) {
        return a.type == ValueType::uint8 && (a.components == 3 || a.components == 4);
    };
    if (VertexArray* colours =
            pick(data_, scalars_, can_be_colour, [](const VertexArray& a) { return is_colour_name(a.name); }))
        take_colours(*colours);
}

void VtkPolygons::take_normals(VertexArray& array) {
    for (std::size_t v = 0; v < array.size(); ++v)
        result_.mesh.normals.emplace_back(array.number(v, 0), array.number(v, 1), array.number(v, 2));
    give_away(array, VertexArray::Role::normals);
}

void VtkPolygons::take_uvs(VertexArray& array) {
    for (std::size_t v = 0; v < array.size(); ++v)
        result_.mesh.uvs.emplace_back(array.number(v, 0), array.number(v, 1));
    give_away(array, VertexArray::Role::uvs);
}

void VtkPolygons::take_colours(VertexArray& array) {
    for (std::size_t v = 0; v < array.size(); ++v) {
        glm::vec4 colour(1.0f);
        for (std::uint32_t k = 0; k < array.components; ++k)
            colour[static_cast<int>(k)] = static_cast<float>(array.number(v, k) / 255.0);
        result_.mesh.colours.push_back(decode_colour(colour, source_.options.colours));
    }
    give_away(array, VertexArray::Role::colours);
}

ReadResult VtkPolygons::finish() {
    faces_.warn();
    if (vertex_cells_ + lines_ > 0)
        result_.warnings.push_back(counted(vertex_cells_, "vertex cell") + " and " + counted(lines_, "line") +
                                   " were left out: only polygons and triangle strips are kept.");
    if (!cell_arrays_.names.empty())
        result_.notes.push_back("values of cells were left out: " + listed(cell_arrays_.names) +
                                "; those of points are kept.");
    if (!other_arrays_.names.empty())
        result_.notes.push_back("arrays of text, of bits and of other lengths than the points' were left out: " +
                                listed(other_arrays_.names) + ".");
    if (!partial_arrays_.names.empty())
        result_.notes.push_back(
            "arrays that not all pieces have alike were left out: " + listed(partial_arrays_.names) + ".");
    give_roles();
    keep_arrays(result_, std::move(data_));
    return std::move(result_);
}

} // namespace unseen::meshio
