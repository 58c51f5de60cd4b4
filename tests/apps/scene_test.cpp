// Scenes of glTF files: what the session makes of them, and what the command draws and writes.
#include "run_command.h"

#include <unseen/perception/fold_measurement.h>
#include <unseen/session/session.h>

#include "mesh_files.h"
#include "shapes.h"
#include "tree_checks.h"

namespace scene_test {

using namespace unseen;
using namespace unseen::app::testing;
using session::Goal;
using session::LoadAs;

// A bumpy body that looks different from all sides, and whose mirror image is another one.
vdtree::Mesh body(double length = 1) {
    vdtree::Mesh mesh = shapes::bumpy_sphere(4, 0.05);
    for (glm::dvec3& p : mesh.positions) {
        p.x *= length * (1 + 0.5 * p.y);
        p.z += 0.3 * p.x * p.y;
    }
    return mesh;
}

// Meshes of a file, with what the test says of nodes and so on.
class File {
public:
    explicit File(const std::string& rest) : document_(Json::parse(rest)) {
        document_["asset"]["version"] = "2.0";
        document_["meshes"] = document_["accessors"] = document_["bufferViews"] = Json::array();
    }

    File& add(const vdtree::Mesh& mesh, const std::string& name = "body") {
        std::vector<glm::vec3> positions(mesh.positions.begin(), mesh.positions.end());
        const auto p = accessor(positions.data(), sizeof(glm::vec3), positions.size(), 1, 5126, "VEC3");
        std::vector<glm::dvec3> sums(mesh.positions.size(), glm::dvec3(0));
        for (const vdtree::Triangle& t : mesh.triangles) {
            const glm::dvec3 a = mesh.positions[t[0]];
            for (const vdtree::Index v : t) sums[v] += glm::cross(mesh.positions[t[1]] - a, mesh.positions[t[2]] - a);
        }
        std::vector<glm::vec3> normals;
        for (const glm::dvec3& sum : sums) normals.emplace_back(glm::normalize(sum));
        const auto n = accessor(normals.data(), sizeof(glm::vec3), normals.size(), 1, 5126, "VEC3");
        const auto i =
            accessor(mesh.triangles.data(), sizeof(vdtree::Triangle), mesh.triangles.size(), 3, 5125, "SCALAR");
        document_["meshes"].push_back(
            {{"name", name}, {"primitives", {{{"attributes", {{"POSITION", p}, {"NORMAL", n}}}, {"indices", i}}}}});
        return *this;
    }
    Json& document() { return document_; }

    std::string glb() const {
        Json whole = document_;
        if (!data_.empty()) whole["buffers"] = {{{"byteLength", data_.size()}}};
        return mesh_files::glb(whole.dump(), data_);
    }

private:
    std::size_t accessor(const void* values, std::size_t size, std::size_t count, std::size_t components, int type,
                         const char* name) {
        document_["bufferViews"].push_back({{"buffer", 0}, {"byteOffset", data_.size()}, {"byteLength", size * count}});
        data_.append(static_cast<const char*>(values), size * count);
        document_["accessors"].push_back({{"bufferView", document_["bufferViews"].size() - 1},
                                          {"componentType", type},
                                          {"count", count * components},
                                          {"type", name}});
        return document_["accessors"].size() - 1;
    }

    Json document_;
    std::string data_;
};

// Turned, mirrored, sheared (a turn between two scales), nested; two of them alike.
constexpr const char* all_kinds = R"({"nodes": [
    {"name": "plain", "mesh": 0, "translation": [-3, 0, 0]},
    {"name": "turned", "mesh": 0, "rotation": [0, 0.6, 0, 0.8], "scale": [0.5, 0.5, 0.5]},
    {"name": "mirrored", "mesh": 0, "scale": [-1, 1, 1], "translation": [3, 0, 0]},
    {"name": "flattened", "scale": [1, 0.5, 1], "translation": [-3, 3, 0], "children": [4]},
    {"name": "sheared", "mesh": 0, "rotation": [0, 0, 0.6, 0.8], "scale": [1, 1, 0.7]},
    {"name": "group", "translation": [0, 3, 0], "children": [6]},
    {"name": "nested", "mesh": 0, "translation": [3, 0, 0], "scale": [1, 0.5, 1]},
    {"name": "nested again", "mesh": 0, "translation": [0, 3, 0], "scale": [0.5, 0.25, 0.5]}],
    "scenes": [{"nodes": [0, 1, 2, 3, 5, 7]}]})";

class SceneTest : public CommandTest {
protected:
    Result<session::Scene> load(const std::string& glb, LoadAs as = LoadAs::automatic,
                                session::LoadOptions options = {}) const {
        write_text(path("s.glb"), glb);
        options.as = as;
        options.cache.is_off = true;
        options.measures = false;
        return session::Scene::load(path("s.glb"), options);
    }
    std::string complaint(const File& file) const {
        const auto loaded = load(file.glb());
        return loaded ? "" : loaded.error().message;
    }
    // Pixels that the judge sees change between two pictures, drawn by these words.
    void expect_same_picture(Words a, Words b) const {
        for (const auto& [words, picture] : {std::pair(&a, "a.pfm"), std::pair(&b, "b.pfm")}) {
            words->insert(words->begin(), "render");
            words->insert(words->end(), {"-o", picture, "--size", "256x256", "--samples", "16"});
            succeed(*words);
        }
        const Outcome compared = run({"compare", "a.pfm", "b.pfm", "--json", "-"});
        EXPECT_EQ(compared.json()["visible_pixels"], 0) << compared.out;
        const auto image_a = perception::read_image(path("a.pfm")), image_b = perception::read_image(path("b.pfm"));
        double sum = 0, most = 0;
        for (std::size_t i = 0; i < image_a->image.values.size(); ++i) {
            sum += std::abs(static_cast<double>(image_a->image.values[i] - image_b->image.values[i]));
            most = std::max(most, static_cast<double>(image_a->image.values[i]));
        }
        EXPECT_GT(most, 30) << "there is something to be seen";
        EXPECT_LT(sum / static_cast<double>(image_a->image.values.size()), 0.25) << "cd/m2, of 100";
    }
};

TEST_F(SceneTest, PartsTransformsIntoSimilaritiesAndStretches) {
    const auto scene = require(load(File(all_kinds).add(body()).glb()));
    const auto model = require(load(File(all_kinds).add(body()).glb(), LoadAs::model));
    ASSERT_EQ(scene->objects.size(), 6u);
    ASSERT_EQ(model->objects.size(), 1u);
    EXPECT_TRUE(scene->is_of_file());
    EXPECT_FALSE(model->is_of_file());
    // Every corner of every triangle is where the reader of models puts it.
    std::multiset<std::array<int, 3>> in_scene, in_model;
    const auto put = [](const session::Scene& from, std::multiset<std::array<int, 3>>& into) {
        for (const session::Object& object : from.objects) {
            const vdtree::Mesh mesh = [&] {
                vdtree::Cut cut(object.tree);
                cut.unfold_all();
                return vdtree::extract_mesh(cut);
            }();
            for (const vdtree::Triangle& t : mesh.triangles) {
                glm::dvec3 middle(0);
                for (const vdtree::Index v : t) middle += object.placement.to_world(mesh.positions[v]) / 3.0;
                into.insert({static_cast<int>(std::lround(middle.x * 500)),
                             static_cast<int>(std::lround(middle.y * 500)),
                             static_cast<int>(std::lround(middle.z * 500))});
            }
        }
    };
    put(*scene, in_scene);
    put(*model, in_model);
    ASSERT_EQ(in_scene.size(), in_model.size());
    std::size_t missing = 0;
    for (const auto& place : in_model) missing += !in_scene.contains(place);
    EXPECT_LT(missing, in_model.size() / 100) << "but for those that are rounded another way";
}

TEST_F(SceneTest, InstancesShareOneTree) {
    const auto scene = require(load(File(all_kinds).add(body()).glb()));
    const auto tree = [&](const std::string& name) {
        for (const session::Object& object : scene->objects)
            if (object.name == name) return &object.tree.data();
        return static_cast<const vdtree::VertexTree::Data*>(nullptr);
    };
    EXPECT_EQ(tree("plain"), tree("turned")) << "one allocation";
    EXPECT_EQ(tree("nested"), tree("nested again")) << "the same stretch";
    EXPECT_NE(tree("plain"), tree("nested"));
    EXPECT_NE(tree("plain"), tree("mirrored"));
    EXPECT_NE(tree("plain"), tree("sheared"));
    std::set<const vdtree::VertexTree::Data*> all;
    for (const session::Object& object : scene->objects) all.insert(&object.tree.data());
    EXPECT_EQ(all.size(), 4u);
    for (const session::Object& object : scene->objects)
        EXPECT_FALSE(perception::has_fold_measurement(object.tree)) << "which takes long, and is not asked for here";
}

TEST_F(SceneTest, MeasuresEachTreeOnceForAllItsObjects) {
    auto scene =
        require(load(File(R"({"nodes": [{"mesh": 0}, {"mesh": 0, "translation": [3, 0, 0]}]})").add(body()).glb()));
    EXPECT_FALSE(scene->lights) << "nothing is turned, so the trees' own light will do";
    auto session = require(session::Session::create(std::move(*scene)));
    constexpr double small = 0.05; // of the window
    const auto simplified = require(session->simplify(session->frame({0, 0, 1}, small, session->default_view())));
    EXPECT_TRUE(perception::has_fold_measurement(session->tree(0)));
    EXPECT_EQ(&session->tree(0).data(), &session->tree(1).data());
    EXPECT_EQ(simplified->source_triangles, session->triangle_count());
    EXPECT_LT(simplified->stats.triangles, session->triangle_count());
}

TEST_F(SceneTest, KnowsBackgroundCameraAndLights) {
    auto scene = require(load(File(R"({"nodes": [
        {"mesh": 0, "name": "statue"}, {"mesh": 0, "name": "background", "scale": [9, 9, 9]},
        {"camera": 0, "translation": [0, 0, 4]},
        {"extensions": {"KHR_lights_punctual": {"light": 0}}},
        {"extensions": {"KHR_lights_punctual": {"light": 1}}, "translation": [0, 5, 0]}],
        "cameras": [{"type": "perspective", "perspective": {"yfov": 1}}],
        "extensions": {"KHR_lights_punctual": {"lights": [
            {"type": "directional", "intensity": 1000, "extras": {"casts_shadow": true}},
            {"type": "point", "intensity": 10}]}}})")
                                  .add(body())
                                  .glb()));
    EXPECT_EQ(scene->objects.size(), 1u);
    ASSERT_EQ(scene->backdrop.size(), 1u);
    EXPECT_EQ(&scene->backdrop[0].tree.data(), &scene->objects[0].tree.data());
    ASSERT_TRUE(scene->lights);
    EXPECT_EQ(scene->lights->description(), "1 directional, 1 point, ambient 0.15");
    EXPECT_EQ(scene->lights->casting(), std::vector<std::size_t>{0});
    auto lighting = scene->lights->at(0, scene->objects[0].tree, {}, {});
    ASSERT_EQ(lighting.lights.size(), 2u);
    EXPECT_NEAR(lighting.lights[0].intensity, 0.85, 0.01) << "white that faces the light is as bright as can be";
    auto session = require(session::Session::create(std::move(*scene)));
    const vdtree::View view = session->default_view();
    EXPECT_EQ(view.eye, glm::dvec3(0, 0, 4));
    EXPECT_NEAR(view.fov_y_degrees, 57.29577951, 1e-6);
    EXPECT_EQ(require(session->plan(view, {}))->fold_test, session::FoldTest::error);
}

TEST_F(SceneTest, FollowsAsItSimplifiesFromScratch) {
    // Objects come into the window and leave it; what is spared must not show.
    std::string nodes;
    for (int i = 0; i < 12; ++i)
        nodes += (i ? "," : "") + std::string(R"({"mesh": 0, "translation": [)") + std::to_string(3 * i) + ", 0, 0]}";
    auto scene = require(load(File("{\"nodes\": [" + nodes + "]}").add(body()).glb()));
    auto session = require(session::Session::create(std::move(*scene)));
    session::Follower follower(*session);
    session::Request request;
    request.fold_test = session::FoldTest::luebke_hallen;
    request.purpose = session::Purpose::picture;
    request.reasons = false;
    vdtree::View view;
    view.fov_y_degrees = 40;
    bool was_spared = false;
    for (int frame = 0; frame < 60; ++frame) {
        const double x = 0.7 * (frame < 30 ? frame : 60 - frame);
        view.eye = {x, 1, 6}, view.target = {x, 0, 0};
        const auto followed = require(follower.follow(view, request));
        EXPECT_TRUE(followed->effects.empty());
        const auto fresh = require(session->simplify(view, request));
        EXPECT_LE(followed->stats.triangles, fresh->stats.triangles) << frame;
        for (std::size_t i = 0; i < 12; ++i) {
            EXPECT_EQ(follower.cut(i).triangle_count(), fresh->cuts[i].triangle_count()) << frame << " " << i;
            was_spared = was_spared || fresh->cuts[i].triangle_count() == 0;
        }
    }
    EXPECT_TRUE(was_spared);
}

TEST_F(SceneTest, NamesNodesThatCannotBePlaced) {
    for (const std::string scale : {"[1, 0, 1]", "[0, 0, 0]", "[1, 1e-9, 1]"})
        EXPECT_THAT(
            complaint(
                File(R"({"nodes": [{"mesh": 0}, {"mesh": 0, "name": "leaf", "scale": )" + scale + "}]}").add(body())),
            AllOf(HasSubstr("node 1 'leaf'"), HasSubstr("without an inverse")));
    EXPECT_THAT(complaint(File(R"({"nodes": [{"mesh": 0}, {"mesh": 0, "name": "leaf",
        "matrix": [1e308, 0, 0, 0, 0, 1e308, 0, 0, 0, 0, 1e308, 0, 0, 0, 0, 1], "children": [2]},
        {"mesh": 0, "scale": [1e10, 1, 1]}]})")
                              .add(body())),
                HasSubstr("NaN or infinite"));
    EXPECT_TRUE(
        load(File(R"({"nodes": [{"mesh": 0, "scale": [1e-12, 1e-12, 1e-12]}, {"mesh": 0}]})").add(body()).glb()))
        << "what is tiny is none the less there";
    ASSERT_TRUE(load(File(all_kinds).add(body()).glb(), LoadAs::automatic));
    EXPECT_TRUE(require(session::Scene::load(path("s.glb")))->is_of_file()) << "by default the content decides";
    for (const char* scale : {"1e-300", "1e200"})
        EXPECT_THAT(complaint(File(std::string(R"({"nodes": [{"mesh": 0}, {"mesh": 0, "name": "leaf", "scale": [)") +
                                   scale + "," + scale + "," + scale + "]}]}")
                                  .add(body())),
                    HasSubstr("s.glb: node 1 'leaf' is too small, too large or too far away"));
    session::LoadOptions painted;
    painted.texture = "x.png";
    EXPECT_THAT(error_in(load(File(all_kinds).add(body()).glb(), LoadAs::automatic, painted)),
                HasSubstr("load.texture"));
}

TEST_F(SceneTest, ThousandsOfNodesAreQuicklyRead) {
    std::string nodes;
    for (int i = 0; i < 5000; ++i)
        nodes += (i ? "," : "") + std::string(R"({"mesh": 0, "translation": [)") + std::to_string(i) + ", 0, 0]}";
    EXPECT_EQ(require(load(File("{\"nodes\": [" + nodes + "]}").add(shapes::cube(2)).glb()))->objects.size(), 5000u);
}

TEST_F(SceneTest, NodesMultiplyAFileWithinBounds) {
    const auto nodes = [](int count, const char* key, const char* others, double step) {
        std::string text;
        for (int i = 0; i < count; ++i)
            text += (i ? "," : "") + std::string("{\"mesh\": 0, \"") + key + "\": [" + std::to_string(1 + step * i) +
                    others + "]}";
        return File("{\"nodes\": [" + text + "]}").add(shapes::icosphere(5));
    };
    EXPECT_THAT(complaint(nodes(20'000, "translation", ", 0, 0", 3)),
                HasSubstr("s.glb: its 20,000 nodes multiply to far more than the file holds"));
    EXPECT_THAT(complaint(nodes(60, "scale", ", 1, 1", 0.01)), HasSubstr("multiply to far more than the file holds"));
}

TEST_F(SceneTest, LooksLikeTheSameThingsAsOneModel) {
    write_text(path("s.glb"), File(all_kinds).add(body()).glb());
    if (!no_opengl().empty()) GTEST_SKIP() << "no OpenGL";
    const Words view = {"--eye", "2", "3", "12", "--target", "0", "1.5", "0", "--fov", "50"};
    Words scene = joined({"s.glb", "--full"}, view);
    const Words model = joined({"s.glb", "--full", "--as", "model"}, view);
    expect_same_picture(scene, model);
    scene[1] = "--imperceptible";
    expect_same_picture(scene, model);
}

TEST_F(SceneTest, WritesScenesThatLookTheSame) {
    write_text(path("s.glb"), File(all_kinds).add(body()).glb());
    if (!no_opengl().empty()) GTEST_SKIP() << "no OpenGL";
    const Words view = {"--eye", "2", "3", "12", "--target", "0", "1.5", "0", "--fov", "50"};
    const Json report =
        succeed(
            joined({"simplify", "s.glb", "-o", "small.glb", "--pixels", "4", "--size", "256x256", "--json", "-"}, view))
            .json();
    EXPECT_EQ(report["as"], "scene");
    ASSERT_EQ(report["objects"].size(), 6u);
    std::uint64_t sum = 0;
    for (const Json& object : report["objects"]) sum += object["triangles"].get<std::uint64_t>();
    EXPECT_EQ(sum, report["triangles"]);

    const auto read = require(meshio::SceneFile::read(path("small.glb")));
    ASSERT_EQ(read->contents().nodes.size(), 6u);
    Words names;
    for (const meshio::SceneNode& node : read->contents().nodes) names.push_back(node.name);
    EXPECT_THAT(names, Contains("nested again"));
    EXPECT_LT(report["triangles"], 0.9 * report["source_triangles"].get<double>());
    // What a picture is drawn of folds by the same test, but for what it does not show.
    expect_same_picture(joined({"s.glb", "--pixels", "4"}, view),
                        joined({"small.glb", "--full", "--as", "scene"}, view));
}

TEST_F(SceneTest, WritesWholeMeshesOnce) {
    write_text(path("s.glb"), File(R"({"nodes": [{"mesh": 0}, {"mesh": 0, "name": "background"},
        {"mesh": 0, "scale": [1, 2, 1]}]})")
                                  .add(body())
                                  .glb());
    ASSERT_EQ(run({"simplify", "s.glb", "-o", "whole.glb", "--full"}).status, 0);
    const auto in = require(meshio::SceneFile::read(path("s.glb"))),
               out = require(meshio::SceneFile::read(path("whole.glb")));
    EXPECT_EQ(out->contents().nodes[2].mesh, 0) << "the stretch is the node's";
    EXPECT_EQ(out->contents().nodes[2].to_world, in->contents().nodes[2].to_world);
}

TEST_F(SceneTest, WritesEqualCutsOnce) {
    write_text(
        path("s.glb"),
        File(R"({"nodes": [{"mesh": 0}, {"mesh": 0}, {"mesh": 0, "translation": [0, 0, -9]}]})").add(body()).glb());
    ASSERT_EQ(run({"simplify", "s.glb", "-o", "cut.glb", "--pixels", "4", "--size", "256x256"}).status, 0);
    const auto out = require(meshio::SceneFile::read(path("cut.glb")));
    ASSERT_EQ(out->contents().nodes.size(), 3u);
    EXPECT_EQ(out->contents().nodes[1].mesh, out->contents().nodes[0].mesh);
    EXPECT_NE(out->contents().nodes[2].mesh, out->contents().nodes[0].mesh) << "it is farther away";
}

TEST_F(SceneTest, MayBeEmpty) {
    write_text(path("s.glb"), File(R"({"nodes": [{"camera": 0}],
        "cameras": [{"type": "perspective", "perspective": {"yfov": 1}}]})")
                                  .glb());
    const Outcome drawn = run({"render", "s.glb", "-o", "empty.pfm", "--size", "16x16", "--json", "-"});
    if (drawn.err.find("No OpenGL") != std::string::npos) GTEST_SKIP() << "no OpenGL";
    ASSERT_EQ(drawn.status, 0) << drawn.err;
    EXPECT_EQ(drawn.json()["triangles"], 0);
    const auto picture = perception::read_image(path("empty.pfm"));
    for (const float value : picture->image.values) EXPECT_NEAR(value, 20, 1e-3) << "the background";
    EXPECT_EQ(run({"render", "s.glb", "-o", "empty.png", "--size", "16x16"}).status, 0) << "in words, too";
}

TEST_F(SceneTest, SaysWhichItWas) {
    write_text(path("s.glb"), File(all_kinds).add(body()).glb());
    const Json scene = run({"info", "s.glb", "--json"}).json();
    EXPECT_EQ(scene["kind"], "scene");
    EXPECT_EQ(scene["objects"], 6);
    EXPECT_EQ(scene["meshes"][0]["nodes"], 6);
    EXPECT_EQ(run({"info", "s.glb", "--json", "--as", "model"}).json()["kind"], "mesh");
    write_text(path("one.glb"), File(R"({"nodes": [{"mesh": 0}]})").add(body()).glb());
    EXPECT_EQ(run({"info", "one.glb", "--json"}).json()["kind"], "mesh");
    EXPECT_EQ(run({"info", "one.glb", "--json", "--as", "scene"}).json()["kind"], "scene");
    EXPECT_THAT(run({"simplify", "s.glb", "--as", "scene", "-o", "x.ply"}), fails(1, HasSubstr("--as model")));
    EXPECT_EQ(run({"simplify", "s.glb", "-o", "x.ply", "--triangles", "50%"}).status, 0) << "one mesh";
}

TEST_F(SceneTest, MakesScenesOfEachKind) {
    for (const std::string kind : {"museum", "treasure", "house", "forest", "spheres", "bunnies", "models"}) {
        ASSERT_EQ(run({"make", "scene", kind, "-o", kind + ".glb", "--triangles", "30000"}).status, 0);
        ASSERT_EQ(run({"make", "scene", kind, "-o", "again.glb", "--triangles", "30000"}).status, 0);
        EXPECT_EQ(read_text(path(kind + ".glb")), read_text(path("again.glb"))) << "the same every time";
        const Json scene = run({"info", kind + ".glb", "--json"}).json();
        EXPECT_EQ(scene["kind"], "scene");
        EXPECT_FALSE(scene["camera"].is_null());
        EXPECT_FALSE(scene["lights"].empty());
        EXPECT_GT(scene["background_triangles"], 0);
    }
    EXPECT_EQ(run({"info", "forest.glb", "--json"}).json()["objects"], 1000);
    for (const char* kind : {"spheres.glb", "bunnies.glb", "models.glb"})
        EXPECT_EQ(run({"info", kind, "--json"}).json()["objects"], 40) << kind;
    // Statues with more triangles than an object may have are simplified.
    write_ball("ball.obj", 40, 60); // 4,680 triangles
    const Outcome less = succeed(
        {"make", "scene", "bunnies", "-o", "less.glb", "--mesh", "ball.obj", "--triangles", "40000", "--json", "-"});
    EXPECT_LE(less.json()["triangles"], 44'000);
    EXPECT_GT(less.json()["triangles"], 30'000);
    ASSERT_EQ(run({"make", "scene", "forest", "-o", "other.glb", "--triangles", "30000", "--seed", "2"}).status, 0);
    EXPECT_NE(read_text(path("forest.glb")), read_text(path("other.glb")));
    const auto bars = [&](const Words& words) {
        EXPECT_EQ(run(joined({"make", "scene", "museum", "-o", "m.glb", "--triangles", "10000"}, words)).status, 0);
        std::uint64_t count = 0;
        const Json info = run({"info", "m.glb", "--json"}).json();
        for (const Json& mesh : info["meshes"])
            if (mesh["name"] == "gate" || mesh["name"] == "window bars") count += mesh["nodes"].get<std::uint64_t>();
        return count;
    };
    EXPECT_EQ(bars({"--bars", "none"}), 0u);
    EXPECT_EQ(bars({"--bars", "gate", "--bars-per-metre", "10"}), 31u) << "three metres";
    EXPECT_EQ(bars({"--bars-per-metre", "10"}), 31u + 25u);
    EXPECT_THAT(
        run({"make", "scene", "treasure", "-o", "n.glb", "--mesh", "ball.obj", "--triangles", "10000"}).err,
        ::testing::AllOf(HasSubstr("note: 'ball' is left out: it has "), HasSubstr(" triangles, and a statue here ")));
    EXPECT_EQ(run({"make", "scene", "house", "-o", "x.glb", "--bars", "none"}).status, 2);
    EXPECT_EQ(run({"make", "scene", "cave", "-o", "x.glb"}).status, 2);
    EXPECT_EQ(run({"make", "scene", "forest", "-o", "x.glb", "--triangles", "5"}).status, 2);
    EXPECT_EQ(run({"make", "scene", "museum", "-o", "x.glb", "--mesh", "gone.ply"}).status, 1);
}

} // namespace scene_test
