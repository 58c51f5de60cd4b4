// Static levels of models with seams and hard edges, beside those of meshoptimizer with as many triangles.
#include <algorithm>
#include <cmath>
#include <filesystem>

#include <glm/geometric.hpp>
#include <glm/trigonometric.hpp>

#include <picture_columns.h>
#include <unseen/session/level_chain.h>
#include <unseen/session_gpu/lod.h>
#include <unseen/session_gpu/picture_judge.h>

#include "accuracy.h"
#include "benches.h"
#include "peer_simplify.h"
#include "surface_distance.h"
#include "terminal.h"

namespace unseen::app {
namespace {

using vdtree::Index;

struct Share {
    double of_triangles;
    const char* name;
};
constexpr Share shares[] = {{0.5, "half"}, {0.3, "30%"}, {0.1, "a tenth"}};
constexpr bool is_in_the_sheet(const Share& share) { return share.of_triangles != 0.3; }

// The same from all sides, as in a chain of levels.
vdtree::Cut static_cut(AccuracySubject& subject, double share) {
    session::LevelChainOptions options;
    options.levels = 2, options.most_share = options.least_share = share, options.least_triangles = 1;
    const auto chain = require(session::level_chain(subject.session, subject.view, picture_request(), 0, options));
    return chain.cut(chain.size() - 1);
}

double uv_area(const vdtree::Mesh& mesh) {
    double area = 0;
    for (const vdtree::Triangle& t : mesh.triangles) {
        const auto uv = [&](std::size_t k) { return glm::dvec2(mesh.uvs[t[k]]); };
        const glm::dvec2 a = uv(1) - uv(0), b = uv(2) - uv(0);
        area += 0.5 * std::abs(a.x * b.y - a.y * b.x);
    }
    return area;
}

// The share of corners whose normals are more than 20 degrees off their face.
double bent_corners(const vdtree::Mesh& mesh) {
    const double least = std::cos(glm::radians(20.0));
    double bent = 0, all = 0;
    for (const vdtree::Triangle& t : mesh.triangles) {
        const auto p = [&](std::size_t k) { return mesh.positions[t[k]]; };
        const glm::dvec3 face = glm::cross(p(1) - p(0), p(2) - p(0));
        const double length = glm::length(face);
        if (!(length > 0)) continue;
        for (const Index v : t) {
            const glm::dvec3 normal(mesh.normals[v]);
            bent += !(glm::dot(face / length, normal) >= least * glm::length(normal));
            ++all;
        }
    }
    return bent / std::max(all, 1.0);
}

class CornerBench {
public:
    explicit CornerBench(AccuracySubject& subject)
        : subject_(subject), mesh_(whole_mesh(subject.session.tree())),
          renderer_(std::make_shared<session::SceneRenderer>(
              require(session::SceneRenderer::create(subject.context, subject.session)))) {
        constexpr int sides = 6;
        const session::WorldSphere sphere = session::world_sphere(subject.session.scene().objects[0]);
        const double distance = glm::distance(subject.view.eye, sphere.centre);
        for (const glm::dvec3& direction : session::lod_directions(sides, 1)) {
            vdtree::View& view = views_.emplace_back(subject.view);
            view.target = sphere.centre;
            view.eye = sphere.centre + distance * direction;
            judges_.push_back(
                require(session::PictureJudge::create(renderer_, subject.session, view, accuracy_samples)));
        }
    }

    AccuracyPoints points() {
        show("whole", grouped(mesh_.triangles.size()) + " triangles", *renderer_,
             session::whole_cuts(subject_.session));
        AccuracyPoints points;
        for (const Share& share : shares) {
            std::vector<vdtree::Cut> cuts;
            cuts.push_back(static_cut(subject_, share.of_triangles));
            points.push_back(point("ours", share, vdtree::extract_mesh(cuts[0]), *renderer_, cuts));
            points.back().is_default = true;
            if (!has_meshoptimizer()) continue;
            const vdtree::Mesh simple = simplified_by_meshoptimizer(mesh_, cuts[0].triangle_count());
            const session::Session peer = require(session::Session::create(
                session::Scene::of(tree_like(subject_.session.tree(), simple)), subject_.session.observer()));
            auto drawn = require(session::SceneRenderer::create(subject_.context, peer));
            points.push_back(point("meshoptimizer", share, simple, drawn, session::whole_cuts(peer)));
        }
        return points;
    }

    void write_sheet() const {
        const auto sheet = require(compose_columns(
            subject_.name + "   ours and meshoptimizer's, of as many triangles; below, their edges", columns_));
        require(perception::write_image(std::filesystem::path(subject_.pictures) / corner_sheet_name(subject_.name),
                                        sheet));
    }

private:
    AccuracyPoint point(const std::string& whose, const Share& share, const vdtree::Mesh& simple,
                        session::SceneRenderer& renderer, const std::vector<vdtree::Cut>& cuts) {
        double pixels = 0, v = 0;
        for (std::size_t i = 0; i < views_.size(); ++i) {
            const auto frame = require(renderer.draw(session::drawn_cuts(cuts), views_[i], judges_[i].drawing()));
            const auto seen = require(judges_[i].judge(frame));
            pixels += static_cast<double>(std::max(seen.visible_pixels, seen.second_visible_pixels));
            v = std::max({v, seen.v, seen.second_v});
        }
        const auto triangles = static_cast<double>(simple.triangles.size());
        const bool is_stuck = triangles > 1.1 * share.of_triangles * static_cast<double>(mesh_.triangles.size());
        if (is_in_the_sheet(share))
            show(whose + ", " + share.name,
                 grouped(simple.triangles.size()) + " triangles, " + grouped(static_cast<std::uint64_t>(pixels)) +
                     " visible pixels",
                 renderer, cuts);
        return {
            .name = whose + ", " + share.name,
            .values = {triangles, pixels, v,
                       mesh_.uvs.empty() ? std::numeric_limits<double>::quiet_NaN() : uv_area(simple) / uv_area(mesh_),
                       bent_corners(simple), 1e6 * mean_surface_distance(mesh_, simple)},
            .note = is_stuck ? "stops there" : ""};
    }

    // A column of the sheet.
    void show(const std::string& name, const std::string& verdict, session::SceneRenderer& renderer,
              const std::vector<vdtree::Cut>& cuts) {
        if (subject_.pictures.empty()) return;
        vdtree::View window = subject_.view;
        window.width = window.height = 360;
        const vdtree::View near = subject_.session.frame({0.45, 0.35, 0.82}, 0.95, window);
        PictureColumn& column = columns_.emplace_back(PictureColumn{name, verdict});
        for (const bool has_edges : {false, true}) {
            render::DrawOptions drawing = judges_[0].drawing();
            drawing.wireframe = has_edges;
            const auto frame = require(renderer.draw(session::drawn_cuts(cuts), near, drawing));
            column.pictures.push_back(session::code_image(frame, subject_.session.observer().display));
        }
    }

    AccuracySubject& subject_;
    vdtree::Mesh mesh_;
    std::shared_ptr<session::SceneRenderer> renderer_;
    std::vector<vdtree::View> views_;
    std::vector<session::PictureJudge> judges_; // by view
    std::vector<PictureColumn> columns_;
};

} // namespace

std::string corner_sheet_name(const std::string& subject) { return "corners_" + subject + ".png"; }

AccuracyPoints corner_points(AccuracySubject& subject) {
    if (!subject.session.tree().has_seams()) {
        subject.left_out.push_back("all of it, for it has neither seams nor hard edges.");
        return {};
    }
    CornerBench bench(subject);
    AccuracyPoints points = bench.points();
    if (!subject.pictures.empty()) bench.write_sheet();
    return points;
}

} // namespace unseen::app
