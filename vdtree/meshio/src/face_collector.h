// Faces as files have them, made into triangles: polygons are cut, strips unrolled, bad faces counted and left out.
#pragma once

#include "mesh_readers.h"
#include "polygon_triangulator.h"

namespace unseen::meshio {

// Vertices that faces name by their numbers, from 0 on: a run of those of the mesh, whose positions are there.
struct FaceVertices {
    std::uint64_t first = 0, count = 0;
};

// One for each file. `where` of the following names the face for a message: "line 7: face 3".
class FaceCollector {
public:
    explicit FaceCollector(ReadResult& result) : result_(result) {}

    // Corners may be any numbers.
    template <class Where>
    void add_polygon(std::span<const std::int64_t> corners, const FaceVertices& vertices, Where&& where) {
        ++result_.source_faces;
        if (!are_there(corners, vertices, false, where)) return;
        if (corners.size() < 3) {
            ++small_faces_;
            return;
        }
        if (!has_places(corners, vertices)) return;
        const auto index = [&](std::size_t i) { return vertex(corners[i], vertices); };
        if (corners.size() == 3) {
            result_.mesh.triangles.push_back({index(0), index(1), index(2)});
            return;
        }
        points_.clear();
        for (std::size_t i = 0; i < corners.size(); ++i) points_.push_back(result_.mesh.positions[index(i)]);
        for (const Triangle& t : polygons_.cut(points_))
            result_.mesh.triangles.push_back({index(t[0]), index(t[1]), index(t[2])});
    }

    // Every second triangle of a strip runs the other way round. With restarts, -1 begins a new one.
    template <class Where>
    void add_strip(std::span<const std::int64_t> corners, const FaceVertices& vertices, bool has_restarts,
                   Where&& where) {
        if (!are_there(corners, vertices, has_restarts, where)) {
            ++result_.source_faces;
            return;
        }
        std::size_t start = 0;
        for (std::size_t i = 0; i < corners.size(); ++i) {
            if (corners[i] == -1) {
                start = i + 1;
                continue;
            }
            if (i < start + 2) continue;
            ++result_.source_faces;
            if (!has_places(corners.subspan(i - 2, 3), vertices)) continue;
            const Index a = vertex(corners[i - 2], vertices), b = vertex(corners[i - 1], vertices),
                        c = vertex(corners[i], vertices);
            if ((i - start) % 2 == 0) result_.mesh.triangles.push_back({a, b, c});
            else result_.mesh.triangles.push_back({b, a, c});
        }
    }

    // Tells of what was done, when all faces are there.
    void warn() {
        if (small_faces_ > 0)
            result_.warnings.push_back(counted_were(small_faces_, "face") +
                                       " left out for having fewer than 3 corners.");
        if (const auto fanned = polygons_.fanned_concave(); fanned > 0)
            result_.warnings.push_back(counted_were(fanned, "intricate concave polygon") + " cut into a fan.");
    }

private:
    static Index vertex(std::int64_t corner, const FaceVertices& vertices) {
        return static_cast<Index>(vertices.first + static_cast<std::uint64_t>(corner));
    }

    template <class Where>
    bool are_there(std::span<const std::int64_t> corners, const FaceVertices& vertices, bool has_restarts,
                   Where&& where) {
        for (const std::int64_t corner : corners) {
            if (has_restarts && corner == -1) continue;
            if (corner >= 0 && static_cast<std::uint64_t>(corner) < vertices.count) continue;
            leave_out_face(result_.bad, [&] {
                return text_of(where(), " uses vertex ", corner, ", but the vertices are numbered 0 to ",
                               static_cast<std::int64_t>(vertices.count) - 1);
            });
            return false;
        }
        return true;
    }

    // False where a corner is a bad vertex; then the face is left out.
    bool has_places(std::span<const std::int64_t> corners, const FaceVertices& vertices) {
        if (result_.bad.vertices == 0 || std::all_of(corners.begin(), corners.end(), [&](std::int64_t corner) {
                return is_finite(result_.mesh.positions[vertex(corner, vertices)]);
            }))
            return true;
        ++result_.bad.left_out;
        return false;
    }

    ReadResult& result_;
    PolygonTriangulator polygons_;
    std::vector<glm::dvec3> points_;
    std::uint64_t small_faces_ = 0;
};

} // namespace unseen::meshio
