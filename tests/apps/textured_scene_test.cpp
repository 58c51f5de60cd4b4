// A model of somebody else's as people have them: several meshes, materials and textures in one glTF file, through the
// command from end to end. The horse and the asteroid of Debian's package glmark2-data, with the texture coordinates that
// they have there, and two of its images.
#include "run_command.h"

#include <bit>

#include "gltf_scene.h"

namespace textured_scene_test {

using namespace unseen::app::testing;
using unseen::support::GltfContents;
using unseen::support::read_gltf;

const fs::path package = "/usr/share/glmark2";

struct Model {
    std::vector<float> positions, uvs; // three and two a vertex
    std::vector<std::uint32_t> corners;
};

// Of a 3DS file with one mesh: chunks of a tag of 2 bytes and a length of 4, some of which hold others.
class Reader {
public:
    explicit Reader(std::string bytes) : bytes_(std::move(bytes)) {}
    Model read() {
        walk(0, bytes_.size());
        return std::move(model_);
    }

private:
    template <class T>
    T at(std::size_t place) const {
        static_assert(std::endian::native == std::endian::little);
        if (place + sizeof(T) > bytes_.size()) throw std::runtime_error("the 3DS file is cut off");
        T value;
        std::memcpy(&value, bytes_.data() + place, sizeof(T));
        return value;
    }
    void floats(std::size_t place, std::size_t a_vertex, std::vector<float>& to) {
        const std::size_t count = at<std::uint16_t>(place) * a_vertex;
        for (std::size_t i = 0; i < count; ++i) to.push_back(at<float>(place + 2 + 4 * i));
    }
    void walk(std::size_t from, std::size_t end) {
        while (from + 6 <= end) {
            const auto tag = at<std::uint16_t>(from);
            const std::size_t length = at<std::uint32_t>(from + 2);
            std::size_t inside = from + 6;
            if (length < 6) throw std::runtime_error("the 3DS file has a chunk without its own head");
            if (tag == 0x4000) inside = bytes_.find('\0', inside) + 1; // an object, after its name
            if (tag == 0x4D4D || tag == 0x3D3D || tag == 0x4000 || tag == 0x4100) walk(inside, from + length);
            if (tag == 0x4110) floats(inside, 3, model_.positions);
            if (tag == 0x4140) floats(inside, 2, model_.uvs);
            if (tag == 0x4120)
                for (std::size_t i = 0; i < at<std::uint16_t>(inside); ++i)
                    for (std::size_t k = 0; k < 3; ++k)
                        model_.corners.push_back(at<std::uint16_t>(inside + 2 + 8 * i + 2 * k));
            from += length;
        }
    }

    std::string bytes_;
    Model model_;
};

// A .gltf of meshes with a material and a texture each, beside its buffer and its images.
class Draft {
public:
    void add(const std::string& name, const Model& model, const std::string& image, Json node) {
        const std::size_t mesh = json_["meshes"].size();
        std::vector<float> low(3, 1e30f), high(3, -1e30f);
        for (std::size_t i = 0; i < model.positions.size(); ++i) {
            low[i % 3] = std::min(low[i % 3], model.positions[i]);
            high[i % 3] = std::max(high[i % 3], model.positions[i]);
        }
        const std::size_t positions = put(model.positions, 5126, "VEC3", model.positions.size() / 3);
        json_["accessors"].back()["min"] = low;
        json_["accessors"].back()["max"] = high;
        const std::size_t uvs = put(model.uvs, 5126, "VEC2", model.uvs.size() / 2);
        const std::size_t corners = put(model.corners, 5125, "SCALAR", model.corners.size());
        json_["images"].push_back({{"uri", image}, {"name", image}});
        json_["textures"].push_back({{"source", mesh}, {"sampler", 0}});
        json_["materials"].push_back(
            {{"name", name + " skin"},
             {"pbrMetallicRoughness",
              {{"baseColorTexture", {{"index", mesh}}}, {"metallicFactor", 0}, {"roughnessFactor", 0.9}}}});
        json_["meshes"].push_back({{"name", name + " mesh"},
                                   {"primitives",
                                    {{{"attributes", {{"POSITION", positions}, {"TEXCOORD_0", uvs}}},
                                      {"indices", corners},
                                      {"material", mesh}}}}});
        node["name"] = name;
        node["mesh"] = mesh;
        json_["scenes"][0]["nodes"].push_back(json_["nodes"].size());
        json_["nodes"].push_back(std::move(node));
    }
    void set_camera(double z, double fov_y) {
        json_["cameras"] = {{{"type", "perspective"}, {"perspective", {{"yfov", fov_y}, {"znear", 0.01}}}}};
        json_["scenes"][0]["nodes"].push_back(json_["nodes"].size());
        json_["nodes"].push_back({{"name", "camera"}, {"camera", 0}, {"translation", {0, 0, z}}});
    }
    void write(const fs::path& file) {
        json_["buffers"] = {{{"uri", "data.bin"}, {"byteLength", bytes_.size()}}};
        write_text(file.parent_path() / "data.bin", bytes_);
        write_text(file, json_.dump());
    }

private:
    template <class T>
    std::size_t put(const std::vector<T>& values, int type, const char* shape, std::size_t count) {
        json_["bufferViews"].push_back(
            {{"buffer", 0}, {"byteOffset", bytes_.size()}, {"byteLength", sizeof(T) * values.size()}});
        bytes_.append(reinterpret_cast<const char*>(values.data()), sizeof(T) * values.size());
        json_["accessors"].push_back({{"bufferView", json_["bufferViews"].size() - 1},
                                      {"componentType", type},
                                      {"count", count},
                                      {"type", shape}});
        return json_["accessors"].size() - 1;
    }

    Json json_ = {{"asset", {{"version", "2.0"}}},
                  {"scene", 0},
                  {"scenes", {{{"nodes", Json::array()}}}},
                  {"samplers", {{{"wrapS", 10497}, {"wrapT", 10497}}}}};
    std::string bytes_;
};

class TexturedSceneTest : public CommandTest {
protected:
    void SetUp() override {
        CommandTest::SetUp();
        for (const char* file :
             {"models/horse.3ds", "models/asteroid-low.3ds", "textures/crate-base.png", "textures/nasa1.png"})
            if (!fs::exists(package / file))
                GTEST_SKIP() << (package / file).string()
                             << " is missing: install Debian's package glmark2-data to run this test";
        fs::create_directories(path("in"));
        Draft draft;
        for (const auto& [name, file, image, at] : {std::tuple{"horse", "horse.3ds", "crate-base.png", -0.6},
                                                    {"asteroid", "asteroid-low.3ds", "nasa1.png", 0.7}}) {
            const Model model = Reader(read_text(package / "models" / file)).read();
            ASSERT_GT(model.corners.size(), 1000u);
            ASSERT_EQ(model.uvs.size() / 2, model.positions.size() / 3);
            float least = 1e30f, most = -1e30f;
            for (const float p : model.positions) least = std::min(least, p), most = std::max(most, p);
            const double scale = 1.0 / static_cast<double>(most - least);
            fs::copy_file(package / "textures" / image, path("in") / image);
            draft.add(name, model, image,
                      {{"translation", {at, 0, 0}}, {"scale", {scale, scale, scale}}, {"rotation", {0, 0.6, 0, 0.8}}});
        }
        draft.set_camera(6, 0.4);
        draft.write(path("in/scene.gltf"));
    }
};

TEST_F(TexturedSceneTest, GoesThroughTheCommandFromEndToEnd) {
    const Words window = {"--size", "256x256"};
    const auto with = [&](Words words) {
        words.insert(words.end(), window.begin(), window.end());
        return words;
    };
    const Outcome drawn = run(with({"render", "in/scene.gltf", "-o", "a.png"}));
    if (drawn.err.find("No OpenGL") != std::string::npos) GTEST_SKIP() << drawn.err;
    ASSERT_EQ(drawn.status, 0) << drawn.err;
    const GltfContents in = read_gltf(path("in/scene.gltf"));

    const Outcome made =
        succeed(with({"simplify", "in/scene.gltf", "-o", "small.glb", "--visibility", "picture", "--json", "-"}));
    const GltfContents out = read_gltf(path("small.glb"));
    std::size_t before = 0, after = 0;
    for (const auto& [name, triangles] : in.triangles) before += triangles.size();
    for (const auto& [name, triangles] : out.triangles) after += triangles.size();
    EXPECT_LT(after, before);
    EXPECT_GT(after, 0u);
    RecordProperty("triangles", std::to_string(after) + " of " + std::to_string(before));

    // Nobody sees a difference in the view that it was made for.
    for (const auto& [model, picture] : {std::pair("in/scene.gltf", "full.pfm"), {"small.glb", "small.pfm"}})
        succeed(with({"render", model, "-o", picture, "--full", "--samples", "16"}));
    const Json compared = succeed({"compare", "full.pfm", "small.pfm", "--json", "-"}).json();
    EXPECT_EQ(compared["visible_pixels"], 0) << compared.dump();
    // There is something to be seen, of both textures.
    succeed(with({"render", "in/scene.gltf", "-o", "plain.pfm", "--full", "--no-texture"}));
    EXPECT_GT(run({"compare", "full.pfm", "plain.pfm", "--json", "-"}).json()["visible_pixels"], 1000);

    // Materials, textures and names stay, also of a rough cut.
    succeed({"simplify", "in/scene.gltf", "-o", "rough.glb", "--triangles", "2000"});
    for (const char* file : {"small.glb", "rough.glb"}) {
        const GltfContents cut = read_gltf(path(file));
        EXPECT_EQ(cut.images.size(), 2u) << file;
        EXPECT_EQ(cut.images, in.images) << file;
        const Json info = succeed({"info", file, "--json"}).json();
        ASSERT_EQ(info["materials"].size(), 2u) << info.dump(1);
        EXPECT_EQ(info["materials"][0]["name"], "horse skin");
        EXPECT_EQ(info["materials"][0]["image"], "crate-base.png");
        EXPECT_EQ(info["materials"][1]["name"], "asteroid skin");
        EXPECT_EQ(info["materials"][1]["image"], "nasa1.png");
        EXPECT_EQ(info["meshes"][0]["name"], "horse");
        EXPECT_EQ(info["meshes"][1]["name"], "asteroid");
        EXPECT_EQ(info["camera"]["name"], "camera");
        EXPECT_THAT(succeed({"info", file}).out, HasSubstr("material 'horse skin': image crate-base.png"));
        succeed(with({"render", file, "-o", "again.png"}));
    }
}

// As one model, under its own light: nothing is seen, and aside or far away little is kept.
TEST_F(TexturedSceneTest, FoldsWhereNobodySeesIt) {
    const auto draw = [&](const Words& view, const Words& how) {
        Words words = joined({"render", "in/scene.gltf", "--as", "model", "--size", "256x256", "--json", "-"}, view);
        words.insert(words.end(), how.begin(), how.end());
        return run(words);
    };
    const auto aside = [](Words view) {
        view.insert(view.end(), {"--gaze", "1200", "128"});
        return view;
    };
    struct Far {
        Words view;
        double most_kept; // of the triangles
    };
    const Far far[] = {{{"--direction", "0", "0.2", "1", "--fill", "0.5"}, 1.01},
                       {{"--direction", "-1", "0.5", "-0.4", "--fill", "0.1"}, 0.97},
                       {aside({"--direction", "1", "-0.3", "0.2", "--fill", "0.3"}), 0.32},
                       {aside({"--direction", "0", "0.2", "1", "--fill", "0.1"}), 0.15},
                       {{"--direction", "0", "0.2", "1", "--fill", "0.02"}, 0.22}};
    for (const Far& look : far) {
        const Outcome whole = draw(look.view, {"--full", "-o", "whole.pfm"});
        if (whole.err.find("No OpenGL") != std::string::npos) GTEST_SKIP() << whole.err;
        ASSERT_EQ(whole.status, 0) << whole.err;
        const Outcome cut = draw(look.view, {"-o", "cut.pfm"});
        ASSERT_EQ(cut.status, 0) << cut.err;
        EXPECT_THAT(effect_named(cut.json(), "fold test")["why"].get<std::string>(), ::testing::StartsWith("error:"));
        Words words = {"compare", "whole.pfm", "cut.pfm", "--json", "-"};
        if (look.view.size() > 6) words.insert(words.end(), look.view.end() - 3, look.view.end());
        EXPECT_EQ(succeed(words).json()["visible_pixels"], 0);
        const double kept = cut.json()["triangles"].get<double>() / whole.json()["triangles"].get<double>();
        EXPECT_LT(kept, look.most_kept);
    }
}

} // namespace textured_scene_test
