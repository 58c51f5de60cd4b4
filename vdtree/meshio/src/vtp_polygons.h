// Pieces of polygons with data by point, as VTK's XML has them, and how they become a mesh.
#pragma once

#include <cstdint>
#include <set>
#include <string>
#include <vector>

#include "face_collector.h"
#include "mesh_readers.h"

namespace unseen::meshio {

// Thrown inside of the readers of VTK files, and made an error by them. `what` is a sentence without the file's name.
struct VtkFault {
    std::string what;
    ErrorCode code = ErrorCode::malformed_data;
};
Error error_of(const MeshSource& source, const VtkFault& fault);

struct VtkCells {
    std::vector<std::int64_t> ends;    // by cell: where its corners end; the next cell's begin there
    std::vector<std::int64_t> corners; // numbers of points, or whatever the file says
};

// As a file says it. Arrays of `data` have a tuple for each point.
struct VtkPiece {
    std::string name;   // for messages: empty, or "piece 2: "
    VertexArray points; // of 3 components
    VtkCells polygons, strips;
    std::uint64_t vertex_cells = 0, lines = 0;
    std::vector<VertexArray> data;
    std::string scalars, normals, uvs;                  // names of those arrays of data that are marked as such
    std::vector<std::string> cell_arrays, other_arrays; // names of what is not read
};

class VtkPolygons {
public:
    explicit VtkPolygons(const MeshSource& source) : source_(source) {}

    // Throws VtkFault on cells whose ends go backwards or past the corners, and where the caller wants to stop.
    void add(VtkPiece piece);
    ReadResult finish();

private:
    // In their order, each once.
    struct NameList {
        std::vector<std::string> names;
        std::set<std::string> known;

        void add(const std::vector<std::string>& more);
    };

    void add_cells(const VtkPiece& piece, const VtkCells& cells, const FaceVertices& vertices, bool are_strips);
    void add_data(VtkPiece& piece);
    void give_roles();
    void take_normals(VertexArray& array);
    void take_colours(VertexArray& array);
    void take_uvs(VertexArray& array);

    const MeshSource& source_;
    ReadResult result_;
    FaceCollector faces_{result_};
    bool has_pieces_ = false;
    std::uint64_t vertex_cells_ = 0, lines_ = 0;
    std::vector<VertexArray> data_;
    std::string scalars_, normals_, uvs_;
    NameList cell_arrays_, other_arrays_, partial_arrays_;
};

} // namespace unseen::meshio
