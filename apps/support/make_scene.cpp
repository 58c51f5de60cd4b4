#include "make_scene.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <numbers>
#include <optional>
#include <string>
#include <system_error>

#include <unseen/meshio/mesh_file.h>
#include <unseen/vdtree/builder.h>
#include <unseen/vdtree/cut.h>
#include <unseen/vdtree/internal/errors.h>

#include "scene_draft.h"
#include "scene_parts.h"
#include "subdivide.h"

namespace unseen::app {
namespace {

namespace fs = std::filesystem;

constexpr const char* bunny = "/usr/share/glmark2/models/bunny.obj";

// Lux and such are of no account for the picture: white that faces the sun is at 1, less the ambient light.
constexpr double sun_lux = 1;

// Shape alone, a metre high.
vdtree::Mesh bare(vdtree::Mesh mesh) {
    vdtree::Mesh shape;
    shape.positions = std::move(mesh.positions), shape.triangles = std::move(mesh.triangles);
    return set_upright(std::move(shape));
}

// By a quadric hierarchy, as unobtrusively as so many triangles can be.
Result<vdtree::Mesh> with_at_most(const vdtree::Mesh& mesh, std::uint64_t triangles) {
    if (mesh.triangles.size() <= triangles) return mesh;
    const auto tree = vdtree::build_tree(mesh.view());
    if (!tree) return tree.error();
    vdtree::Cut cut(*tree);
    const std::span<const float> sizes = tree->displacement();
    cut.adjust(
        [&](const vdtree::VertexTree&, std::span<const vdtree::NodeId> nodes, std::span<float> costs) {
            for (std::size_t i = 0; i < nodes.size(); ++i) costs[i] = sizes[nodes[i]];
        },
        static_cast<vdtree::Index>(triangles));
    return bare(vdtree::extract_mesh(cut));
}

class Maker {
public:
    explicit Maker(const MakeSceneOptions& options) : options_(options), chance_(options.seed) {}

    std::vector<std::string> left_out() && { return std::move(left_out_); }
    Result<SceneDraft> run() {
        if (const auto read = read_statues(); !read) return read.error();
        Result<void> made;
        switch (options_.kind) {
        case SceneKind::museum: made = museum(); break;
        case SceneKind::treasure: made = treasure(); break;
        case SceneKind::house: made = house(); break;
        case SceneKind::forest: made = forest(); break;
        case SceneKind::building: made = building(); break;
        case SceneKind::spheres: made = spheres(); break;
        case SceneKind::bunnies: made = bunnies(); break;
        case SceneKind::models: made = models(); break;
        }
        if (!made) return made.error();
        return std::move(draft_);
    }

private:
    std::uint64_t triangles(std::uint64_t usual) const { return options_.triangles > 0 ? options_.triangles : usual; }
    static std::uint64_t at_least(std::uint64_t least, std::uint64_t triangles) { return std::max(least, triangles); }

    Result<void> read_statues() {
        std::vector<fs::path> files = options_.statues;
        std::error_code failure;
        if (files.empty() && fs::is_regular_file(bunny, failure)) files = {bunny};
        for (const fs::path& file : files) {
            auto read = meshio::read_mesh(file);
            if (!read) return read.error();
            scanned_.push_back({file.stem().string(), bare(std::move(read->mesh))});
        }
        return {};
    }

    // One of each kind, of about so many triangles each: scanned ones, refined, where they have no more than that, and
    // two that are made.
    Result<std::vector<std::size_t>> statues(std::uint64_t triangles, std::size_t most = 100) {
        std::vector<std::size_t> made;
        for (const Scanned& scanned : scanned_) {
            if (made.size() == most) continue;
            if (scanned.mesh.triangles.size() > triangles) {
                if (!options_.statues.empty())
                    left_out_.push_back("'" + scanned.name + "' is left out: it has " +
                                        std::to_string(scanned.mesh.triangles.size()) +
                                        " triangles, and a statue here " + std::to_string(triangles) +
                                        "; simplify it, or give more --triangles.");
                continue;
            }
            auto mesh = subdivide(scanned.mesh, {.triangles = triangles, .seed = options_.seed});
            if (!mesh) return mesh.error();
            made.push_back(draft_.add_mesh(scanned.name, std::move(*mesh), 0.7));
        }
        return completed(std::move(made), triangles, most);
    }

    // As they are where they have no more than so many triangles, else simplified to that; and as many made ones as are
    // missing.
    Result<std::vector<std::size_t>> models_of(std::uint64_t triangles, std::size_t count) {
        std::vector<std::size_t> made;
        for (const Scanned& scanned : scanned_) {
            if (made.size() == count) break;
            auto mesh = with_at_most(scanned.mesh, triangles);
            if (!mesh) return mesh.error();
            made.push_back(draft_.add_mesh(scanned.name, std::move(*mesh), 0.7));
        }
        return completed(std::move(made), triangles, count);
    }

    // With made ones as long as there is room.
    std::vector<std::size_t> completed(std::vector<std::size_t> made, std::uint64_t triangles, std::size_t most) {
        if (made.size() < most) made.push_back(draft_.add_mesh("knot", knot(triangles), 0.55));
        if (made.size() < most) made.push_back(draft_.add_mesh("great urn", urn(triangles), 0.65));
        return made;
    }

    // Forty objects on a plain in the sun. `at`: where each stands.
    void plain(const std::vector<std::size_t>& meshes, double size, const std::function<glm::dvec3(int)>& at,
               double wide, double deep) {
        for (int i = 0; i < crowd; ++i)
            draft_.add(meshes[static_cast<std::size_t>(i) % meshes.size()], "object " + std::to_string(i),
                       {.at = at(i), .turn_degrees = chance_.next(0, 360), .scale = glm::dvec3(size)});
        const double side = std::max(wide, deep) + 40;
        draft_.add(draft_.add_mesh("ground", ground(side, 60, 0.0, options_.seed), 0.35), "ground", {.at = {0, 0, 0}},
                   true);
        draft_.add_sun({0.4, 0.8, 0.5}, sun_lux);
        draft_.set_light(0.8, 0.2);
        draft_.set_camera({-wide / 2, 1.7, deep / 2}, {0, 1.2, 0}, 60);
    }

    // Each somewhere in its cell.
    std::function<glm::dvec3(int)> in_cells(double cell, double stray) {
        return [this, cell, stray](int i) {
            return glm::dvec3((i % across - (across - 1) * 0.5) * cell + chance_.next(-stray, stray), 0,
                              (i / across - (crowd / across - 1) * 0.5) * cell + chance_.next(-stray, stray));
        };
    }

    Result<void> spheres() {
        const std::size_t mesh = draft_.add_mesh("sphere", sphere(triangles(crowd * 28'560) / crowd), 0.6);
        plain({mesh}, 1.8, in_cells(3, 0.3), across * 3, crowd / across * 3);
        return {};
    }

    Result<void> bunnies() {
        const auto meshes = models_of(triangles(crowd * 70'000) / crowd, 2);
        if (!meshes) return meshes.error();
        plain(*meshes, 1.8, in_cells(7, 2), across * 7, crowd / across * 7);
        return {};
    }

    Result<void> models() {
        const std::uint64_t each = triangles(crowd * 70'000) / crowd;
        auto meshes = models_of(each, 4);
        if (!meshes) return meshes.error();
        meshes->push_back(draft_.add_mesh("sphere", sphere(each * 28'560 / 70'000), 0.6));
        // The first half in a crowd to the left, the others wide apart to the right.
        plain(
            *meshes, 1.8,
            [this](int i) {
                const bool in_crowd = i < crowd / 2;
                const int n = i % (crowd / 2);
                const double cell = in_crowd ? 2.6 : 8;
                return glm::dvec3((in_crowd ? -14 : 12) + (n % 5 - 2) * cell + chance_.next(-0.3, 0.3), 0,
                                  (n / 5 - 1.5) * cell + chance_.next(-0.3, 0.3));
            },
            56, 32);
        return {};
    }

    void wall(const std::string& name, glm::dvec3 size, glm::dvec3 foot, double cell = 0.25, double grey = 0.6) {
        draft_.add(draft_.add_mesh(name, box(size, cell), grey), name, {.at = foot}, true);
    }

    // A gate or grille: bars from left to right, in the plane of the foot; turned by a quarter for windows at the side.
    void bars(const std::string& name, glm::dvec3 foot, double width, double height, bool along_z) {
        const double spacing = 1 / options_.bars_per_metre;
        const auto count = static_cast<int>(std::floor(width / spacing + 1e-9)) + 1;
        constexpr double wrought_iron = 0.05;
        const std::size_t mesh = draft_.add_mesh(name, bar(height, spacing / 5, 10), wrought_iron);
        for (int i = 0; i < count; ++i) {
            const double off = spacing * (i - 0.5 * (count - 1));
            draft_.add(mesh, name, {.at = foot + (along_z ? glm::dvec3(0, 0, off) : glm::dvec3(off, 0, 0))}, true);
        }
    }

    // A statue on a plinth, behind a gate, in the sun that a window lets in from the left.
    Result<void> museum() {
        const auto one = statues(triangles(300'000), 1);
        if (!one) return one.error();
        draft_.add(one->front(), "statue", {.at = {0, 1, 0}, .turn_degrees = 20, .scale = glm::dvec3(1.2)});
        wall("plinth", {1.1, 1, 1.1}, {0, 0, 0}, 0.1, 0.5);
        wall("floor", {8, 0.2, 8}, {0, -0.2, 0});
        wall("back wall", {8, 4, 0.3}, {0, 0, -3.15});
        wall("right wall", {0.3, 4, 8}, {4.15, 0, 0});
        wall("ceiling", {8, 0.2, 8}, {0, 4, 0});
        // The left wall has an opening, z -1.2 to 1.2 and y 1.2 to 3.4.
        wall("left wall below", {0.3, 1.2, 8}, {-4.15, 0, 0});
        wall("left wall above", {0.3, 0.6, 8}, {-4.15, 3.4, 0});
        wall("left wall behind", {0.3, 2.2, 2.8}, {-4.15, 1.2, -2.6});
        wall("left wall before", {0.3, 2.2, 2.8}, {-4.15, 1.2, 2.6});
        const bool has_gate = options_.bars == MuseumBars::both || options_.bars == MuseumBars::gate;
        const bool has_window = options_.bars == MuseumBars::both || options_.bars == MuseumBars::window;
        if (has_gate) bars("gate", {0, 0, 1}, 3, 2.8, false); // close to the statue: as fine as its window's shadow
        if (has_window) bars("window bars", {-4.15, 1.2, 0}, 2.4, 2.2, true);
        draft_.add_sun({-0.85, 0.3, 0.05}, sun_lux, true); // so that its beam meets the statue
        draft_.add_lamp({1.5, 3.2, 2.5}, 1.2);
        draft_.set_light(0.75, 0.12);
        draft_.set_camera({0.4, 1.6, 4.2}, {0, 1.45, 0}, 36);
        return {};
    }

    // Two rows of statues, and urns and rings strewn over the floor.
    Result<void> treasure() {
        constexpr int rows = 12, strewn = 160;
        const std::uint64_t all = triangles(2'000'000);
        const auto figures = statues(at_least(200, all * 7 / 10 / (2 * rows)));
        if (!figures) return figures.error();
        const std::uint64_t each = at_least(100, all * 3 / 10 / strewn);
        const std::array<std::size_t, 2> small = {draft_.add_mesh("goblet", urn(each), 0.7),
                                                  draft_.add_mesh("ring", ring(each), 0.75)};
        const std::size_t plinth = draft_.add_mesh("plinth", box({0.9, 0.6, 0.9}, 0.15), 0.45);
        for (int i = 0; i < rows; ++i) {
            for (const int side : {-1, 1}) {
                const glm::dvec3 foot(2.6 * side, 0, 5.0 - 1.25 * i);
                draft_.add(plinth, "plinth", {.at = foot}, true);
                const std::size_t number = static_cast<std::size_t>(2 * i + (side + 1) / 2);
                // Each kind on both sides.
                draft_.add((*figures)[(number + number / 2) % figures->size()], "statue " + std::to_string(number),
                           {.at = foot + glm::dvec3(0, 0.6, 0),
                            .turn_degrees = -90.0 * side + chance_.next(-25, 25),
                            .scale = glm::dvec3(chance_.next(1.0, 1.4))});
            }
        }
        for (int i = 0; i < strewn; ++i) {
            const std::size_t which = static_cast<std::size_t>(i % 2);
            draft_.add(small[which], std::string(which == 0 ? "goblet " : "ring ") + std::to_string(i),
                       {.at = {chance_.next(-1.8, 1.8), 0, chance_.next(-9, 4)},
                        .turn_degrees = chance_.next(0, 360),
                        .scale = glm::dvec3(chance_.next(0.12, 0.35))});
        }
        wall("floor", {9, 0.2, 20}, {0, -0.2, -2});
        wall("left wall", {0.3, 4.5, 20}, {-4.65, 0, -2});
        wall("right wall", {0.3, 4.5, 20}, {4.65, 0, -2});
        wall("back wall", {9, 4.5, 0.3}, {0, 0, -12.15});
        wall("ceiling", {9, 0.2, 20}, {0, 4.5, -2});
        for (const double z : {5.0, -2.0, -9.0}) draft_.add_lamp({0, 4, z}, 3.2, z == 5.0);
        draft_.set_light(0.7, 0.12);
        draft_.set_camera({0, 1.7, 7.4}, {0, 1.1, 0}, 50);
        return {};
    }

    // Columns before a wall with niches and a balcony, trees before all of it.
    Result<void> house() {
        constexpr int columns = 8, niches = 5, bars_of_balcony = 60, trees = 6;
        const std::uint64_t all = triangles(1'500'000);
        const auto figures = statues(at_least(200, all * 4 / 10 / niches));
        if (!figures) return figures.error();
        const std::size_t pillar = draft_.add_mesh("column", column(at_least(200, all * 3 / 10 / columns)), 0.7);
        const std::size_t baluster = draft_.add_mesh("baluster", urn(at_least(100, all / 10 / bars_of_balcony)), 0.7);
        for (int i = 0; i < columns; ++i)
            draft_.add(pillar, "column " + std::to_string(i), {.at = {2.0 * i - 7, 0.3, 1}, .scale = glm::dvec3(4)});
        for (int i = 0; i < niches; ++i)
            draft_.add(
                (*figures)[static_cast<std::size_t>(i) % figures->size()], "statue " + std::to_string(i),
                {.at = {3.0 * i - 6, 1.0, 0.1}, .turn_degrees = chance_.next(-30, 30), .scale = glm::dvec3(1.5)});
        for (int i = 0; i < bars_of_balcony; ++i)
            draft_.add(baluster, "baluster " + std::to_string(i),
                       {.at = {16.0 * (i + 0.5) / bars_of_balcony - 8, 4.7, 1.35}, .scale = {0.45, 0.8, 0.45}});
        for (int i = 0; i < niches; ++i) wall("plinth", {1.2, 0.7, 0.9}, {3.0 * i - 6, 0.3, 0.1}, 0.2, 0.5);
        wall("steps", {17, 0.3, 4}, {0, 0, 0.5}, 0.4);
        wall("front", {17, 9, 0.5}, {0, 0, -1.0}, 0.4, 0.65);
        wall("balcony", {17, 0.4, 2.6}, {0, 4.3, 0.4}, 0.3);
        wall("rail", {17, 0.12, 0.25}, {0, 5.5, 1.35}, 0.3);
        draft_.add(draft_.add_mesh("ground", ground(60, 60, 0.0, options_.seed), 0.35), "ground", {.at = {0, 0, 0}},
                   true);
        const std::array<std::size_t, 2> green = {
            draft_.add_mesh("tree 0", tree(at_least(300, all * 2 / 10 / trees), options_.seed), 0.4),
            draft_.add_mesh("tree 1", tree(at_least(300, all * 2 / 10 / trees), options_.seed + 1), 0.35)};
        for (int i = 0; i < trees; ++i)
            draft_.add(green[static_cast<std::size_t>(i % 2)], "tree " + std::to_string(i),
                       {.at = {3.6 * i - 9 + chance_.next(-0.6, 0.6), 0, 6 + chance_.next(-1, 2)},
                        .turn_degrees = chance_.next(0, 360),
                        .scale = glm::dvec3(chance_.next(0.7, 1.0))});
        draft_.add_sun({0.5, 0.7, 0.8}, sun_lux, true);
        draft_.set_light(0.8, 0.18);
        draft_.set_camera({-2, 1.7, 17}, {0, 3.2, 0}, 45);
        return {};
    }

    // A thousand things in rings around a clearing, from where one walks in.
    Result<void> forest() {
        constexpr int things = 1000, figures_every = 25, kinds_of_trees = 5;
        constexpr int figure_count = things / figures_every;
        const std::uint64_t all = triangles(2'000'000);
        const auto figures = statues(at_least(200, all / 5 / figure_count));
        if (!figures) return figures.error();
        std::vector<std::size_t> trees;
        for (int i = 0; i < kinds_of_trees; ++i)
            trees.push_back(draft_.add_mesh(
                "tree " + std::to_string(i),
                tree(at_least(300, all * 4 / 5 / (things - figure_count)), options_.seed + 10 + i), 0.3 + 0.04 * i));
        // A grid with each thing somewhere in its cell, so that nothing stands in another.
        constexpr int cells = 32;
        constexpr double cell_m = 3.5;
        int placed = 0;
        for (int k = 0; k < cells * cells && placed < things; ++k) {
            const int row = k / cells, column = k % cells;
            const glm::dvec3 at((column - (cells - 1) * 0.5) * cell_m + chance_.next(-1, 1), 0,
                                -row * cell_m + chance_.next(-1, 1));
            const double turn = chance_.next(0, 360), size = chance_.next(0.7, 1.3), lean = chance_.next(-4, 4);
            const bool is_figure = placed % figures_every == 15;
            const std::string number = std::to_string(placed);
            const auto n = static_cast<std::size_t>(placed);
            if (is_figure)
                draft_.add((*figures)[n / figures_every % figures->size()], "statue " + number,
                           {.at = at, .turn_degrees = turn, .scale = glm::dvec3(1.6 * size)});
            else
                draft_.add(trees[n % trees.size()], "tree " + number,
                           {.at = at, .turn_degrees = turn, .scale = glm::dvec3(size), .lean_degrees = lean});
            ++placed;
        }
        draft_.add(draft_.add_mesh("ground", ground(260, 130, 0.4, options_.seed), 0.3), "ground", {.at = {0, 0, -50}},
                   true);
        draft_.add_sun({0.4, 0.8, 0.5}, sun_lux, true);
        draft_.set_light(0.8, 0.2);
        draft_.set_camera({0, 1.7, 9}, {0, 1.8, -20}, 50);
        return {};
    }

    // Fifty rooms in five rows of ten, with a door in each wall between two of them. One walks through the middle row,
    // where the doors are in line; those between rows are each somewhere else in their wall.
    Result<void> building() {
        constexpr int rows = 5, columns = 10, things = 8;
        constexpr double side = 5, thick = 0.2, high = 3, door = 1, door_high = 2.1, pier = (side - door) / 2;
        const std::uint64_t each = at_least(200, triangles(5'000'000) / (rows * columns * things));
        auto kinds = statues(each);
        if (!kinds) return kinds.error();
        kinds->push_back(draft_.add_mesh("sphere", sphere(each), 0.6));
        kinds->push_back(draft_.add_mesh("column", column(each), 0.7));
        kinds->push_back(draft_.add_mesh("ring", ring(each), 0.75));
        const std::size_t table = draft_.add_mesh("table", box({0.8, 0.7, 0.8}, 0.1), 0.45);
        const std::size_t whole = draft_.add_mesh("wall", box({side, high, thick}, 0.25), 0.6);
        const std::size_t half = draft_.add_mesh("pier", box({pier, high, thick}, 0.25), 0.6);
        const std::size_t lintel = draft_.add_mesh("lintel", box({door, high - door_high, thick}, 0.25), 0.6);
        // `middle`: of the wall's foot; `aside`: of the door, from there.
        const auto wall_at = [&](glm::dvec3 middle, double turn_degrees, bool has_door, double aside) {
            if (!has_door) return draft_.add(whole, "wall", {.at = middle, .turn_degrees = turn_degrees}, true);
            const glm::dvec3 along = turn_degrees == 0 ? glm::dvec3(1, 0, 0) : glm::dvec3(0, 0, 1);
            for (const int end : {-1, 1}) // each as wide as the door leaves
                draft_.add(half, "pier",
                           {.at = middle + along * (aside / 2 + end * (pier + door) / 2),
                            .turn_degrees = turn_degrees,
                            .scale = {1 + end * -aside / pier, 1, 1}},
                           true);
            draft_.add(lintel, "lintel",
                       {.at = middle + along * aside + glm::dvec3(0, door_high, 0), .turn_degrees = turn_degrees},
                       true);
        };
        for (int row = 0; row < rows; ++row)
            for (int column = 0; column < columns; ++column) {
                const glm::dvec3 foot((row - rows / 2) * side, 0, -column * side);
                wall_at(foot + glm::dvec3(0, 0, side / 2), 0, column > 0, 0);
                wall_at(foot - glm::dvec3(side / 2, 0, 0), 90, row > 0, chance_.next(-1.2, 1.2));
                if (column + 1 == columns) wall_at(foot - glm::dvec3(0, 0, side / 2), 0, false, 0);
                if (row + 1 == rows) wall_at(foot + glm::dvec3(side / 2, 0, 0), 90, false, 0);
                for (int i = 0; i < things; ++i) { // beside the way between doors, half of them on tables
                    const glm::dvec3 at = foot + glm::dvec3((i % 2 == 0 ? -1 : 1) * chance_.next(1.0, 1.9), 0,
                                                            (i / 2 - 1.5) * 1.1 + chance_.next(-0.2, 0.2));
                    if (i % 3 == 0) draft_.add(table, "table", {.at = at}, true);
                    draft_.add((*kinds)[static_cast<std::size_t>(row + column + i) % kinds->size()],
                               "thing " + std::to_string((row * columns + column) * things + i),
                               {.at = at + glm::dvec3(0, i % 3 == 0 ? 0.7 : 0, 0),
                                .turn_degrees = chance_.next(0, 360),
                                .scale = glm::dvec3(chance_.next(0.7, 1.1))});
                }
            }
        const glm::dvec3 middle(0, 0, -side * (columns - 1) / 2);
        wall("floor", {rows * side, 0.2, columns * side}, middle - glm::dvec3(0, 0.2, 0));
        wall("ceiling", {rows * side, 0.2, columns * side}, middle + glm::dvec3(0, high, 0));
        draft_.add_sun({0.3, 0.8, 0.5}, 0.6);
        draft_.set_light(0.8, 0.3);
        draft_.set_camera({0, 1.6, side / 2 - 0.5}, {0, 1.4, -side}, 60);
        return {};
    }

    static constexpr int crowd = 40, across = 8;
    struct Scanned {
        std::string name;
        vdtree::Mesh mesh;
    };
    const MakeSceneOptions& options_;
    Chance chance_;
    SceneDraft draft_;
    std::vector<Scanned> scanned_;
    std::vector<std::string> left_out_;
};

} // namespace

Result<MadeScene> make_scene(const fs::path& file, const MakeSceneOptions& options) {
    using Options = MakeSceneOptions;
    if (options.triangles != 0 &&
        (options.triangles < Options::least_triangles || options.triangles > Options::most_triangles))
        return invalid_argument("A scene has from " + std::to_string(Options::least_triangles) + " to " +
                                std::to_string(Options::most_triangles) + " triangles, not " +
                                std::to_string(options.triangles) + ".");
    if (!(options.bars_per_metre >= 1 && options.bars_per_metre <= 100))
        return invalid_argument("A metre has from 1 to 100 bars.");
    Maker maker(options);
    const auto draft = maker.run();
    if (!draft) return draft.error();
    MadeScene made;
    made.left_out = std::move(maker).left_out();
    for (const SceneDraft::Mesh& mesh : draft->meshes()) {
        ++made.meshes;
        made.mesh_triangles += mesh.mesh.triangles.size();
    }
    for (const SceneDraft::Node& node : draft->nodes()) {
        const std::uint64_t triangles = draft->meshes()[node.mesh].mesh.triangles.size();
        made.objects += !node.is_background;
        (node.is_background ? made.background_triangles : made.triangles) += triangles;
    }
    if (const auto written = draft->write(file); !written) return written.error();
    return made;
}

} // namespace unseen::app
