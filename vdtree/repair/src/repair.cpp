#include <unseen/repair/repair.h>

#include <algorithm>
#include <limits>
#include <map>
#include <numeric>
#include <optional>
#include <unordered_map>

#include <glm/common.hpp>
#include <glm/geometric.hpp>

#include <CGAL/Exact_predicates_inexact_constructions_kernel.h>
#include <CGAL/Polygon_mesh_processing/border.h>
#include <CGAL/Polygon_mesh_processing/connected_components.h>
#include <CGAL/Polygon_mesh_processing/orient_polygon_soup.h>
#include <CGAL/Polygon_mesh_processing/orientation.h>
#include <CGAL/Polygon_mesh_processing/stitch_borders.h>
#include <CGAL/Polygon_mesh_processing/triangulate_hole.h>
#include <CGAL/Surface_mesh.h>

namespace unseen::repair {

namespace {

using vdtree::Index;
using vdtree::Mesh;
using vdtree::MeshRange;
using vdtree::Triangle;
using vdtree::uses_a_vertex_twice;

namespace pmp = CGAL::Polygon_mesh_processing;
using Kernel = CGAL::Exact_predicates_inexact_constructions_kernel;
using Point = Kernel::Point_3;
using Surface = CGAL::Surface_mesh<Point>;
using Face = Surface::Face_index;
using Halfedge = Surface::Halfedge_index;
using Vertex = Surface::Vertex_index;

constexpr double largest_gap = 0.01;          // share of the diagonal: more is no crack
constexpr std::size_t most_hole_edges = 1000; // triangulate_hole() takes the cube of it where its fast way fails

Triangle from_least(Triangle t) {
    std::rotate(t.begin(), std::min_element(t.begin(), t.end()), t.end());
    return t;
}

struct Box {
    glm::dvec3 low = glm::dvec3(std::numeric_limits<double>::infinity()), high = -low;
    void add(glm::dvec3 p) { low = glm::min(low, p), high = glm::max(high, p); }
    double diagonal() const { return low.x <= high.x ? glm::length(high - low) : 0; }
};

template <class Points>
Box box_of(const Points& points) {
    Box box;
    for (const glm::dvec3& p : points) box.add(p);
    return box;
}

glm::dvec3 vector_of(const Point& p) { return {p.x(), p.y(), p.z()}; }

// Vertices by their positions: each one's place, numbered by first appearance.
struct Places {
    explicit Places(const std::vector<glm::dvec3>& positions) {
        std::map<std::array<double, 3>, Index> numbers;
        for (const glm::dvec3& p : positions) {
            const auto [entry, is_new] = numbers.try_emplace({p.x, p.y, p.z}, static_cast<Index>(points.size()));
            if (is_new) points.emplace_back(p.x, p.y, p.z);
            of_vertex.push_back(entry->second);
        }
    }

    Triangle of(const Triangle& t) const { return {of_vertex[t[0]], of_vertex[t[1]], of_vertex[t[2]]}; }

    std::vector<Index> of_vertex;
    std::vector<Point> points; // by place
};

class Repairer {
public:
    Repairer(Mesh mesh, const Options& options)
        : mesh_(std::move(mesh)), options_(options), diagonal_(box_of(mesh_.positions).diagonal()) {}

    Result<Repaired> run() {
        drop_duplicates();
        close_cracks();
        find_triangles();
        orient_parts();
        make_surface();
        pmp::stitch_borders(surface_);
        cap_holes();
        face_outward();
        turn_normals(write_orientation());
        insert_caps();
        return Repaired{std::move(mesh_), report_};
    }

private:
    // On the same places in the same direction: marked as using a vertex twice, which the following drops.
    void drop_duplicates() {
        const Places places(mesh_.positions);
        std::vector<std::pair<Triangle, Index>> keyed;
        for (std::size_t t = 0; t < mesh_.triangles.size(); ++t) {
            const Triangle at = places.of(mesh_.triangles[t]);
            if (!uses_a_vertex_twice(at)) keyed.emplace_back(from_least(at), static_cast<Index>(t));
        }
        std::sort(keyed.begin(), keyed.end());
        for (std::size_t i = 1; i < keyed.size(); ++i) {
            if (keyed[i].first != keyed[i - 1].first) continue;
            Triangle& t = mesh_.triangles[keyed[i].second];
            t = {t[0], t[0], t[0]};
            ++report_.duplicates;
        }
        vdtree::drop_degenerate_triangles(mesh_);
    }

    using Edges = std::map<std::pair<Index, Index>, int>; // by two places, the lower one first: how many triangles

    // Moves vertices of borders to the first one within the gap that no edge leads to.
    void close_cracks() {
        const double gap = options_.gap * diagonal_;
        if (!(gap > 0)) return;
        const Places places(mesh_.positions);
        Edges uses;
        for (const Triangle& t : mesh_.triangles) {
            const Triangle at = places.of(t);
            if (uses_a_vertex_twice(at)) continue;
            for (std::size_t k = 0; k < 3; ++k) ++uses[std::minmax(at[k], at[(k + 1) % 3])];
        }
        std::vector<std::uint8_t> is_border(places.points.size(), 0);
        for (const auto& [edge, count] : uses)
            if (count == 1) is_border[edge.first] = is_border[edge.second] = 1;
        std::vector<glm::dvec3> positions;
        for (const Point& p : places.points) positions.push_back(vector_of(p));
        const std::vector<Index> target = find_targets(positions, is_border, uses, gap);
        for (std::size_t v = 0; v < mesh_.positions.size(); ++v) {
            const Index place = places.of_vertex[v];
            if (target[place] == place) continue;
            mesh_.positions[v] = positions[target[place]];
            ++report_.moved_vertices;
        }
    }

    // By place: the place that it moves to, which stays where it is. Places lie in cells as large as the gap.
    static std::vector<Index> find_targets(std::span<const glm::dvec3> positions,
                                           std::span<const std::uint8_t> is_border, const Edges& uses, double gap) {
        using Cell = std::array<std::int64_t, 3>;
        const glm::dvec3 low = box_of(positions).low;
        const auto cell_of = [&](glm::dvec3 p) { // at most 1 / gap cells a side: fits, for gaps are no smaller
            const glm::dvec3 c = glm::floor((p - low) / gap);
            return Cell{static_cast<std::int64_t>(c.x), static_cast<std::int64_t>(c.y), static_cast<std::int64_t>(c.z)};
        };
        std::map<Cell, std::vector<Index>> kept; // places that others move to
        std::vector<Index> target(positions.size());
        std::iota(target.begin(), target.end(), Index{0});
        for (Index place = 0; place < target.size(); ++place) {
            if (!is_border[place]) continue;
            const glm::dvec3 p = positions[place];
            const Cell cell = cell_of(p);
            Index nearest = place;
            double distance = gap;
            for (std::int64_t i = 0; i < 27; ++i) {
                const auto there = kept.find(Cell{cell[0] + i % 3 - 1, cell[1] + i / 3 % 3 - 1, cell[2] + i / 9 - 1});
                if (there == kept.end()) continue;
                for (const Index other : there->second) {
                    const double d = glm::distance(p, positions[other]);
                    if (!(d <= distance) || uses.contains(std::minmax(place, other))) continue;
                    nearest = other;
                    distance = d;
                }
            }
            target[place] = nearest;
            if (nearest == place) kept[cell].push_back(place);
        }
        return target;
    }

    // Those with three places, which surfaces are made of.
    void find_triangles() {
        places_.emplace(mesh_.positions);
        points_ = places_->points;
        for (std::size_t t = 0; t < mesh_.triangles.size(); ++t) {
            const Triangle at = places_->of(mesh_.triangles[t]);
            if (uses_a_vertex_twice(at)) continue;
            triangles_.push_back(static_cast<Index>(t));
            polygons_.push_back({at[0], at[1], at[2]});
            for (std::size_t k = 0; k < 3; ++k) ++edge_uses_[std::minmax(at[k], at[(k + 1) % 3])];
        }
    }

    // One orientation for what edges connect: that of most of its triangles. CGAL gives vertices of non-manifold edges
    // points of their own.
    void orient_parts() {
        const auto before = polygons_;
        pmp::orient_polygon_soup(points_, polygons_);
        std::vector<std::uint8_t> is_turned(polygons_.size());
        for (std::size_t i = 0; i < polygons_.size(); ++i)
            is_turned[i] = points_[polygons_[i][0]] != points_[before[i][0]];
        // Parts, by the edges of the oriented polygons.
        std::vector<std::size_t> part(polygons_.size());
        std::iota(part.begin(), part.end(), std::size_t{0});
        const auto root = [&](std::size_t i) {
            while (part[i] != i) i = part[i] = part[part[i]];
            return i;
        };
        std::map<std::pair<std::size_t, std::size_t>, std::size_t> first_at;
        for (std::size_t i = 0; i < polygons_.size(); ++i)
            for (std::size_t k = 0; k < 3; ++k) {
                const auto [entry, is_new] =
                    first_at.try_emplace(std::minmax(polygons_[i][k], polygons_[i][(k + 1) % 3]), i);
                if (!is_new) part[root(i)] = root(entry->second);
            }
        std::vector<std::int64_t> balance(polygons_.size(), 0);
        for (std::size_t i = 0; i < polygons_.size(); ++i) balance[root(i)] += is_turned[i] ? 1 : -1;
        for (std::size_t i = 0; i < polygons_.size(); ++i)
            if (balance[root(i)] > 0) std::reverse(polygons_[i].begin(), polygons_[i].end());
    }

    void make_surface() {
        surface_.reserve(static_cast<Surface::size_type>(points_.size()),
                         static_cast<Surface::size_type>(points_.size() + polygons_.size()),
                         static_cast<Surface::size_type>(polygons_.size()));
        for (const Point& p : points_) surface_.add_vertex(p);
        for (std::size_t i = 0; i < polygons_.size(); ++i) {
            const auto vertex = [&](std::size_t k) { return Vertex(static_cast<Surface::size_type>(polygons_[i][k])); };
            const Face face = surface_.add_face(vertex(0), vertex(1), vertex(2));
            if (face == Surface::null_face()) continue; // stays as it is
            face_triangle_.resize(static_cast<std::size_t>(face) + 1);
            face_triangle_[face] = triangles_[i];
        }
        own_faces_ = face_triangle_.size();
    }

    // The vertex of a triangle that lies at a vertex of the surface.
    Index vertex_at(Index triangle, Vertex v) const {
        const Point& p = surface_.point(v);
        for (const Index corner : mesh_.triangles[triangle])
            if (places_->points[places_->of_vertex[corner]] == p) return corner;
        return mesh_.triangles[triangle][0]; // cannot be: faces have the places of their triangles
    }

    // By face: the diagonal of the box of the connected part that it is in.
    std::vector<double> find_part_diagonals() {
        const auto component = surface_.add_property_map<Face, std::size_t>("f:part", 0).first;
        const std::size_t count = pmp::connected_components(surface_, component);
        std::vector<Box> boxes(count);
        for (const Face face : surface_.faces())
            for (const Vertex v : CGAL::vertices_around_face(surface_.halfedge(face), surface_))
                boxes[component[face]].add(vector_of(surface_.point(v)));
        std::vector<double> diagonals(surface_.num_faces(), 0);
        for (const Face face : surface_.faces()) diagonals[face] = boxes[component[face]].diagonal();
        return diagonals;
    }

    void cap_holes() {
        std::vector<Halfedge> borders;
        pmp::extract_boundary_cycles(surface_, std::back_inserter(borders));
        report_.holes = borders.size();
        if (borders.empty()) return;
        const std::vector<double> part_diagonal = find_part_diagonals();
        for (const Halfedge border : borders) {
            Box box;
            std::map<Vertex, Index> corner_at; // a vertex of the mesh for each of the surface
            std::size_t edges = 0;
            for (const Halfedge h : CGAL::halfedges_around_face(border, surface_)) {
                const Vertex v = surface_.target(h);
                box.add(vector_of(surface_.point(v)));
                corner_at.try_emplace(v, vertex_at(face_triangle_[surface_.face(surface_.opposite(h))], v));
                ++edges;
            }
            const double part = part_diagonal[surface_.face(surface_.opposite(border))];
            // Where CGAL has cut a non-manifold edge there is a border, but no hole.
            const auto place = [&](Vertex v) { return places_->of_vertex[corner_at.at(v)]; };
            bool is_cut = false;
            for (const Halfedge h : CGAL::halfedges_around_face(border, surface_)) {
                const Index from = place(surface_.source(h)), to = place(surface_.target(h));
                is_cut = is_cut || edge_uses_.at({std::min(from, to), std::max(from, to)}) > 1;
            }
            if (is_cut || edges > most_hole_edges || !(box.diagonal() <= options_.largest_hole * part)) continue;
            const Index beside = face_triangle_[surface_.face(surface_.opposite(border))];
            std::vector<Face> patch;
            pmp::triangulate_hole(surface_, border, std::back_inserter(patch));
            report_.capped_holes += !patch.empty();
            report_.cap_triangles += patch.size();
            for (const Face face : patch) {
                if (face_triangle_.size() <= static_cast<std::size_t>(face))
                    face_triangle_.resize(static_cast<std::size_t>(face) + 1);
                face_triangle_[face] = beside;
                caps_.push_back({face, beside, holes_.size()});
            }
            holes_.push_back(std::move(corner_at));
        }
    }

    // Closed parts that face inward are turned, but for those that are the walls of cavities.
    void face_outward() {
        const auto component = surface_.add_property_map<Face, std::size_t>("f:component", 0).first;
        const std::size_t count = pmp::connected_components(surface_, component);
        std::vector<std::uint8_t> is_open(count, 0);
        for (const Halfedge h : surface_.halfedges())
            if (surface_.is_border(h)) is_open[component[surface_.face(surface_.opposite(h))]] = 1;
        Surface closed;
        std::vector<Face> face_of; // by face of the closed surface
        std::unordered_map<std::size_t, Vertex> numbers;
        const auto vertex = [&](Vertex v) {
            const auto [entry, is_new] = numbers.try_emplace(static_cast<std::size_t>(v));
            if (is_new) entry->second = closed.add_vertex(surface_.point(v));
            return entry->second;
        };
        for (const Face face : surface_.faces()) {
            if (is_open[component[face]]) continue;
            const Halfedge h = surface_.halfedge(face);
            closed.add_face(vertex(surface_.source(h)), vertex(surface_.target(h)),
                            vertex(surface_.target(surface_.next(h))));
            face_of.push_back(face);
        }
        if (face_of.empty() || !CGAL::is_closed(closed)) return;
        // Six times the volume, about a vertex of the part, for the sign.
        std::vector<double> volume(count, 0);
        std::vector<std::optional<Point>> centre(count);
        for (const Face face : face_of) {
            const Halfedge h = surface_.halfedge(face);
            std::optional<Point>& from = centre[component[face]];
            if (!from) from = surface_.point(surface_.source(h));
            volume[component[face]] += CGAL::to_double(CGAL::determinant(
                surface_.point(surface_.source(h)) - *from, surface_.point(surface_.target(h)) - *from,
                surface_.point(surface_.target(surface_.next(h))) - *from));
        }
        pmp::orient_to_bound_a_volume(closed);
        outward_.resize(surface_.num_faces(), 0);
        for (std::size_t i = 0; i < face_of.size(); ++i) {
            if (!(volume[component[face_of[i]]] < 0)) continue; // a solid in another one is no cavity
            const Halfedge h = surface_.halfedge(face_of[i]);
            const Vertex from = vertex(surface_.source(h)), to = vertex(surface_.target(h));
            Halfedge there = closed.halfedge(Face(static_cast<Surface::size_type>(i)));
            while (closed.source(there) != from) there = closed.next(there);
            outward_[face_of[i]] = closed.target(there) != to; // turned
        }
    }

    // The corners of a face in its final direction, as points' vertices of the surface.
    std::array<Vertex, 3> corners_of(Face face) const {
        const Halfedge h = surface_.halfedge(face);
        std::array<Vertex, 3> corners{surface_.source(h), surface_.target(h), surface_.target(surface_.next(h))};
        if (!outward_.empty() && outward_[face]) std::swap(corners[1], corners[2]);
        return corners;
    }

    // By triangle: whether it was turned.
    std::vector<std::uint8_t> write_orientation() {
        std::vector<std::uint8_t> turned(mesh_.triangles.size(), 0);
        for (std::size_t i = 0; i < own_faces_; ++i) {
            const auto corners = corners_of(Face(static_cast<Surface::size_type>(i)));
            const Index triangle = face_triangle_[i];
            Triangle& t = mesh_.triangles[triangle];
            const Index first = vertex_at(triangle, corners[0]), second = vertex_at(triangle, corners[1]);
            const auto at = std::find(t.begin(), t.end(), first) - t.begin();
            if (t[static_cast<std::size_t>(at + 1) % 3] == second) continue;
            std::swap(t[1], t[2]);
            turned[triangle] = 1;
            ++report_.turned_triangles;
        }
        return turned;
    }

    void turn_normals(const std::vector<std::uint8_t>& turned) {
        if (mesh_.normals.empty() || report_.turned_triangles == 0) return;
        std::vector<glm::dvec3> sums(mesh_.positions.size(), glm::dvec3(0));
        std::vector<std::uint8_t> is_touched(mesh_.positions.size(), 0);
        for (std::size_t t = 0; t < mesh_.triangles.size(); ++t) {
            const Triangle& corners = mesh_.triangles[t];
            const glm::dvec3 a = mesh_.positions[corners[0]] / diagonal_, b = mesh_.positions[corners[1]] / diagonal_,
                             c = mesh_.positions[corners[2]] / diagonal_;
            for (const Index v : corners) {
                sums[v] += glm::cross(b - a, c - a);
                is_touched[v] |= turned[t];
            }
        }
        for (std::size_t v = 0; v < sums.size(); ++v)
            if (is_touched[v] && glm::dot(sums[v], glm::dvec3(mesh_.normals[v])) < 0)
                mesh_.normals[v] = -mesh_.normals[v];
    }

    // Each behind the triangle beside its hole, in all ranges that have that one.
    void insert_caps() {
        if (caps_.empty()) return;
        std::vector<std::vector<Triangle>> after(mesh_.triangles.size());
        for (const Cap& cap : caps_) {
            const auto corners = corners_of(cap.face);
            const auto& corner_at = holes_[cap.hole];
            after[cap.beside].push_back({corner_at.at(corners[0]), corner_at.at(corners[1]), corner_at.at(corners[2])});
        }
        std::vector<std::uint64_t> place(mesh_.triangles.size() + 1, 0); // by old triangle: where it lies now
        std::vector<Triangle> triangles;
        std::vector<vdtree::Index> smoothing;
        for (std::size_t t = 0; t < mesh_.triangles.size(); ++t) {
            place[t] = triangles.size();
            triangles.push_back(mesh_.triangles[t]);
            triangles.insert(triangles.end(), after[t].begin(), after[t].end());
            if (!mesh_.smoothing.empty()) smoothing.resize(triangles.size(), mesh_.smoothing[t]);
        }
        place.back() = triangles.size();
        for (MeshRange& range : mesh_.ranges) {
            const std::uint64_t end = place[range.first_triangle + range.triangle_count];
            range.first_triangle = place[range.first_triangle];
            range.triangle_count = end - range.first_triangle;
        }
        mesh_.triangles = std::move(triangles);
        mesh_.smoothing = std::move(smoothing);
    }

    struct Cap {
        Face face;
        Index beside;     // the triangle whose edge was the hole's first
        std::size_t hole; // of holes_
    };

    Mesh mesh_;
    const Options& options_;
    double diagonal_; // mesh units
    Report report_;
    std::optional<Places> places_;
    std::vector<Index> triangles_; // by polygon
    std::vector<Point> points_;    // places, then CGAL's own
    std::vector<std::array<std::size_t, 3>> polygons_;
    std::map<std::pair<Index, Index>, int> edge_uses_; // by places: how many triangles there are at the edge
    Surface surface_;
    std::vector<Index> face_triangle_; // by face; of caps: the triangle beside the hole
    std::size_t own_faces_ = 0;        // faces that are triangles of the mesh; caps follow
    std::vector<Cap> caps_;
    std::vector<std::map<Vertex, Index>> holes_; // capped ones: a vertex of the mesh for each of their border
    std::vector<std::uint8_t> outward_;          // by face: turned at the end
};

} // namespace

Result<Repaired> repair(Mesh mesh, const Options& options) {
    if (const auto valid = vdtree::validate(mesh.view()); !valid) return valid.error();
    if (!(options.gap >= 0 && options.gap <= largest_gap))
        return Error{ErrorCode::invalid_argument,
                     "The gap to stitch is a share of the mesh's diagonal, from 0 to 0.01."};
    if (!(options.largest_hole >= 0 && options.largest_hole <= 1))
        return Error{ErrorCode::invalid_argument,
                     "The largest hole to cap is a share of its part's diagonal, from 0 to 1."};
    try {
        return Repairer(std::move(mesh), options).run();
    } catch (const CGAL::Failure_exception& failure) {
        return Error{ErrorCode::unsupported,
                     std::string("CGAL cannot repair this mesh (") + failure.what() + "): build it as it is."};
    }
}

} // namespace unseen::repair
