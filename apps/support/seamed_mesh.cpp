#include "seamed_mesh.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <numbers>
#include <tuple>

#include <glm/geometric.hpp>

namespace unseen::app {
namespace {

using vdtree::Index;
using vdtree::Mesh;

struct SeamedCorner {
    glm::dvec3 place;
    glm::dvec2 uv = glm::dvec2(0);
};

// A mesh put together of triangles. At one place, corners of one group share a normal; different groups meet in a hard
// edge. Places are the same if their coordinates are equal.
class SeamedDraft {
public:
    // `towards`: the side that it faces.
    void triangle(std::array<SeamedCorner, 3> corners, int group, glm::dvec3 towards) {
        glm::dvec3 normal =
            glm::cross(corners[1].place - corners[0].place, corners[2].place - corners[0].place); // twice the area
        if (!(glm::length(normal) > 0)) return;
        if (glm::dot(normal, towards) < 0) {
            std::swap(corners[1], corners[2]);
            normal = -normal;
        }
        vdtree::Triangle& triangle = mesh_.triangles.emplace_back();
        for (std::size_t i = 0; i < 3; ++i) {
            const auto [p, uv] = corners[i];
            const auto next = static_cast<Index>(mesh_.positions.size());
            const auto [at, is_new] = vertices_.try_emplace({p.x, p.y, p.z, uv.x, uv.y, group}, next);
            triangle[i] = at->second;
            normals_[{p.x, p.y, p.z, group}] += normal;
            if (!is_new) continue;
            mesh_.positions.push_back(p);
            mesh_.uvs.emplace_back(uv);
            groups_.push_back(group);
        }
    }
    void quad(const SeamedCorner& a, const SeamedCorner& b, const SeamedCorner& c, const SeamedCorner& d, int group,
              glm::dvec3 towards) {
        triangle({a, b, c}, group, towards);
        triangle({a, c, d}, group, towards);
    }
    // rows x columns quads; `corner` of (row, column), `side` of a quad's first corner.
    template <class At, class Side>
    void net(int rows, int columns, int group, const At& corner, const Side& side) {
        for (int i = 0; i < rows; ++i)
            for (int j = 0; j < columns; ++j)
                quad(corner(i, j), corner(i, j + 1), corner(i + 1, j + 1), corner(i + 1, j), group,
                     side(corner(i, j).place));
    }

    Mesh mesh(vdtree::Texture texture = {}) && {
        for (std::size_t v = 0; v < mesh_.positions.size(); ++v) {
            const glm::dvec3 p = mesh_.positions[v];
            mesh_.normals.emplace_back(glm::normalize(normals_.at({p.x, p.y, p.z, groups_[v]})));
        }
        if (texture.texels.empty()) mesh_.uvs.clear();
        mesh_.texture = std::move(texture);
        return std::move(mesh_);
    }

private:
    Mesh mesh_;
    std::vector<int> groups_; // by vertex
    std::map<std::tuple<double, double, double, double, double, int>, Index> vertices_;
    std::map<std::tuple<double, double, double, int>, glm::dvec3> normals_; // weighted by area
};

// ---- the atlas: 4 x 4 fields with a chart each

constexpr int atlas_fields = 4;

// u and v within the field's chart, 0..1.
glm::dvec2 in_field(int field, double u, double v) {
    constexpr double margin = 1.0 / 16; // of the field, so that mip levels do not mix charts
    const glm::dvec2 inside = margin + (1 - 2 * margin) * glm::dvec2(u, v);
    return (glm::dvec2(field % atlas_fields, field / atlas_fields) + inside) / double(atlas_fields);
}

// Panels with dark joints and light edges on a tone of the field's own, slightly mottled.
vdtree::Texture painted_fields() {
    constexpr std::uint32_t side = 1024, panel = 64, joint = 4; // texels
    constexpr std::array<std::array<int, 3>, 5> tones = {
        {{176, 74, 60}, {196, 184, 160}, {82, 108, 142}, {150, 156, 96}, {96, 88, 84}}};
    vdtree::Texture texture{side, side, vdtree::Wrap::repeat, vdtree::Wrap::repeat, {}};
    for (std::uint32_t y = 0; y < side; ++y)
        for (std::uint32_t x = 0; x < side; ++x) {
            const std::uint32_t field = y / (side / atlas_fields) * atlas_fields + x / (side / atlas_fields);
            const std::uint32_t across = x % panel, down = (y + (x / panel % 2) * panel / 2) % panel;
            const bool is_joint = across < joint || down < joint,
                       is_edge = !is_joint && (across < 2 * joint || down < 2 * joint);
            const int mottle = static_cast<int>((x * 2654435761u ^ y * 2246822519u) >> 28) - 8;
            const int light = (is_joint ? -70 : is_edge ? 30 : 0) + mottle;
            vdtree::Texel& texel = texture.texels.emplace_back(vdtree::Texel{0, 0, 0, 255});
            for (std::size_t c = 0; c < 3; ++c)
                texel[c] = static_cast<std::uint8_t>(std::clamp(tones[field % tones.size()][c] + light, 0, 255));
        }
    return texture;
}

// ---- helmet

constexpr int shell_cells = 32; // along each side of the cube that the shell is made of
// The cells of the front that the visor takes.
constexpr int visor_left = 8, visor_right = 24, visor_low = 12, visor_high = 22;

enum class ShellLayer { outer, visor, inner };

glm::dvec3 of_shell(glm::dvec3 cube, ShellLayer layer) {
    const glm::dvec3 d = glm::normalize(cube);
    constexpr double crest_half_width = 0.25, crest_height = 0.08;
    double radius = layer == ShellLayer::visor ? 0.93 : 0.86;
    if (layer == ShellLayer::outer) {
        radius = 1 + 0.012 * std::sin(9 * d.x + 1) * std::sin(8 * d.y) * std::cos(7 * d.z);
        radius += crest_height * std::max(0.0, 1 - std::abs(cube.x) / crest_half_width);
    }
    return radius * d * glm::dvec3(0.8, 1, 0.95);
}

// Of the cube's side where axis `a` is `side`.
glm::dvec3 on_cube(int a, double side, int row, int column) {
    glm::dvec3 cube;
    cube[a] = side;
    cube[(a + 1) % 3] = 2.0 * column / shell_cells - 1;
    cube[(a + 2) % 3] = 2.0 * row / shell_cells - 1;
    return cube;
}

bool is_front(int a, double side) { return a == 2 && side > 0; }

void add_shell(SeamedDraft& draft, int a, double side, int field) {
    enum Group { shell, crest_left, crest_right, visor, inner };
    for (int i = 0; i < shell_cells; ++i)
        for (int j = 0; j < shell_cells; ++j) {
            const bool is_visor =
                is_front(a, side) && i >= visor_low && i < visor_high && j >= visor_left && j < visor_right;
            const auto corner = [&](int row, int column, ShellLayer layer, int in) {
                return SeamedCorner{of_shell(on_cube(a, side, row, column), layer),
                                    in_field(in, double(column) / shell_cells, double(row) / shell_cells)};
            };
            const auto quad = [&](ShellLayer layer, int in, Group group, double outward) {
                const SeamedCorner first = corner(i, j, layer, in);
                draft.quad(first, corner(i, j + 1, layer, in), corner(i + 1, j + 1, layer, in),
                           corner(i + 1, j, layer, in), group, outward * first.place);
            };
            const double x = (on_cube(a, side, i, j).x + on_cube(a, side, i + 1, j + 1).x) / 2; // of its middle
            const Group outside = std::abs(x) > 0.25 ? shell : x < 0 ? crest_left : crest_right;
            if (is_visor) quad(ShellLayer::visor, 10, visor, 1);
            else quad(ShellLayer::outer, field, outside, 1);
            quad(ShellLayer::inner, field + 5, inner, -1);
        }
}

// From one layer to another along a line of cells; `share` of the chart's length that is behind and is there.
void add_wall(SeamedDraft& draft, glm::dvec3 from, glm::dvec3 to, std::array<ShellLayer, 2> layers, int field,
              int group, std::array<double, 2> share, glm::dvec3 towards) {
    const auto corner = [&](glm::dvec3 cube, std::size_t layer, double along) {
        return SeamedCorner{of_shell(cube, layers[layer]), in_field(field, along, double(layer) / 4)};
    };
    draft.quad(corner(from, 0, share[0]), corner(to, 0, share[0] + share[1]), corner(to, 1, share[0] + share[1]),
               corner(from, 1, share[0]), group, towards);
}

void add_visor_walls(SeamedDraft& draft) {
    const glm::dvec3 middle =
        of_shell(on_cube(2, 1, (visor_low + visor_high) / 2, (visor_left + visor_right) / 2), ShellLayer::visor);
    constexpr int first_group = 5, field = 11;
    constexpr int wide = visor_right - visor_left, high = visor_high - visor_low, around = 2 * (wide + high);
    for (int i = 0; i < around; ++i) {
        const auto at = [](int step) { // once around, from the lower left
            step %= around;
            if (step < wide) return on_cube(2, 1, visor_low, visor_left + step);
            if (step < wide + high) return on_cube(2, 1, visor_low + step - wide, visor_right);
            if (step < 2 * wide + high) return on_cube(2, 1, visor_high, visor_right - (step - wide - high));
            return on_cube(2, 1, visor_high - (step - 2 * wide - high), visor_left);
        };
        const int group = first_group + (i < wide ? 0 : i < wide + high ? 1 : i < 2 * wide + high ? 2 : 3);
        add_wall(draft, at(i), at(i + 1), {ShellLayer::outer, ShellLayer::visor}, field, group,
                 {double(i) / around, 1.0 / around}, middle - of_shell(at(i), ShellLayer::outer));
    }
}

void add_rim(SeamedDraft& draft) {
    constexpr int group = 9, field = 12, around = 4 * shell_cells;
    const auto at = [](int step) { // once around the neck
        const int side = step / shell_cells % 4;
        const double along = 2.0 * (step % shell_cells) / shell_cells - 1;
        return side == 0   ? glm::dvec3(along, -1, 1)
               : side == 1 ? glm::dvec3(1, -1, -along)
               : side == 2 ? glm::dvec3(-along, -1, -1)
                           : glm::dvec3(-1, -1, along);
    };
    for (int i = 0; i < around; ++i)
        add_wall(draft, at(i), at(i + 1), {ShellLayer::outer, ShellLayer::inner}, field, group,
                 {double(i) / around, 1.0 / around}, {0, -1, 0});
}

} // namespace

Mesh helmet() {
    SeamedDraft draft;
    int field = 0;
    for (int a = 0; a < 3; ++a)
        for (const double side : {-1.0, 1.0})
            if (!(a == 1 && side < 0)) add_shell(draft, a, side, field++); // all but the neck
    add_visor_walls(draft);
    add_rim(draft);
    return std::move(draft).mesh(painted_fields());
}

Mesh charted_ball() {
    constexpr int rows = 48, columns = 96, base = 40; // from this row on
    SeamedDraft draft;
    const auto place = [](int i, int j) {
        const double theta = std::numbers::pi * i / rows, phi = 2 * std::numbers::pi * (j % columns) / columns;
        const double across = i % rows == 0 ? 0 : std::sin(theta);
        const double radius = 1 + 0.05 * across * std::sin(6 * theta) * std::cos(5 * phi);
        return radius * glm::dvec3(across * std::cos(phi), std::cos(theta), -across * std::sin(phi));
    };
    const auto outward = [](glm::dvec3 p) { return p; };
    const auto around = [&](int i, int j) { // three fields wide
        return SeamedCorner{place(i, j), {0.02 + 0.71 * j / columns, 0.02 + 0.71 * i / base}};
    };
    for (int j = 0; j < columns; ++j) { // each triangle at the pole has its own middle
        SeamedCorner pole = around(0, j);
        pole.uv.x += 0.71 / (2 * columns);
        draft.triangle({pole, around(1, j), around(1, j + 1)}, 0, pole.place);
    }
    draft.net(
        base - 1, columns, 0, [&](int i, int j) { return around(i + 1, j); }, outward);
    draft.net(
        rows - base, columns, 0,
        [&](int i, int j) {
            const glm::dvec3 p = place(base + i, j);
            return SeamedCorner{p, in_field(15, 0.5 + 0.9 * p.x, 0.5 + 0.9 * p.z)};
        },
        outward);
    return std::move(draft).mesh(painted_fields());
}

Mesh gear() {
    constexpr int teeth = 20, part = 7, pieces = 4, around = teeth * pieces * part; // a tooth: root, flank, tip, flank
    constexpr int high = 10, deep = 8;                                              // cells
    constexpr double root = 0.8, tip = 1, bore = 0.3, half_height = 0.2;
    constexpr std::array<double, pieces + 1> ends = {0, 0.3, 0.45, 0.85, 1}; // of a tooth's angle
    const auto outline = [&](int step) {
        const int tooth = step % around / (pieces * part), piece = step % (pieces * part) / part;
        const double share = double(step % part) / part, from = ends[static_cast<std::size_t>(piece)],
                     to = ends[static_cast<std::size_t>(piece) + 1];
        const double radius = piece == 0   ? root
                              : piece == 1 ? root + share * (tip - root)
                              : piece == 2 ? tip
                                           : tip - share * (tip - root);
        const double angle = 2 * std::numbers::pi * (tooth + from + share * (to - from)) / teeth;
        return radius * glm::dvec2(std::cos(angle), std::sin(angle));
    };
    const auto between = [&](int step, double share) { // from the bore to the outline
        const glm::dvec2 out = outline(step), in = bore * glm::normalize(out);
        return share == 1 ? out : in + share * (out - in);
    };
    const auto corner = [](glm::dvec2 p, double y) { return SeamedCorner{{p.x, y, -p.y}, {}}; };
    const auto level = [&](int row) { return half_height * (2.0 * row / high - 1); };
    SeamedDraft draft;
    constexpr int top = 0, bottom = 1, hole = 2, first_piece = 3;
    for (const double y : {-half_height, half_height})
        draft.net(
            deep, around, y > 0 ? top : bottom, [&](int i, int j) { return corner(between(j, double(i) / deep), y); },
            [&](glm::dvec3) { return glm::dvec3(0, y, 0); });
    draft.net(
        high, around, hole, [&](int i, int j) { return corner(between(j, 0), level(i)); },
        [](glm::dvec3 p) { return glm::dvec3(-p.x, 0, -p.z); });
    for (int piece = 0; piece < teeth * pieces; ++piece)
        draft.net(
            high, part, first_piece + piece, [&](int i, int j) { return corner(outline(piece * part + j), level(i)); },
            [](glm::dvec3 p) { return glm::dvec3(p.x, 0, p.z); });
    return std::move(draft).mesh();
}

Mesh hard_boxes() {
    struct Box {
        glm::dvec3 middle, half;
        double turn; // radians, about the vertical
    };
    constexpr int cells = 16;
    const Box boxes[] = {{{0, 0.3, 0}, {0.8, 0.3, 0.6}, 0},
                         {{-0.2, 0.8, 0.1}, {0.4, 0.2, 0.35}, 0.5},
                         {{1.1, 0.2, 0.5}, {0.2, 0.2, 0.2}, 0.9},
                         {{-1.2, 0.5, -0.2}, {0.15, 0.5, 0.3}, -0.3},
                         {{0.3, 0.25, 1.1}, {0.5, 0.25, 0.1}, 0.2}};
    SeamedDraft draft;
    int group = 0;
    for (const Box& box : boxes)
        for (int a = 0; a < 3; ++a)
            for (const double side : {-1.0, 1.0}) {
                const auto placed = [&](glm::dvec3 p) {
                    const double c = std::cos(box.turn), s = std::sin(box.turn);
                    return glm::dvec3(c * p.x + s * p.z, p.y, c * p.z - s * p.x);
                };
                const auto corner = [&](int i, int j) {
                    glm::dvec3 p;
                    p[a] = side;
                    p[(a + 1) % 3] = 2.0 * j / cells - 1;
                    p[(a + 2) % 3] = 2.0 * i / cells - 1;
                    return SeamedCorner{box.middle + placed(p * box.half), {}};
                };
                glm::dvec3 outward(0);
                outward[a] = side;
                draft.net(cells, cells, group++, corner, [&](glm::dvec3) { return placed(outward); });
            }
    return std::move(draft).mesh();
}

} // namespace unseen::app
