// Small files for the fuzz targets to begin with: make_fuzz_seeds FOLDER writes FOLDER/{mesh,tree,follow,image,text,selection}/.
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>

#include <unseen/calibration/calibration.h>
#include <unseen/meshio/mesh_file.h>
#include <unseen/perception/image.h>
#include <unseen/session/internal/selections.h>
#include <unseen/vdtree/builder.h>
#include <unseen/vdtree/tree_io.h>

#include "built.h"
#include "compressed_glb.h"
#include "jpeg_file.h"
#include "mesh_files.h"
#include "shapes.h"
#include "vtp_files.h"

namespace {

namespace fs = std::filesystem;
using namespace unseen::vdtree;
using namespace std::string_literals;
namespace meshio = unseen::meshio;
namespace shapes = unseen::shapes;

void expect(const unseen::Result<void>& done) {
    if (!done) throw std::runtime_error(done.error().message);
}

void write(const fs::path& file, const std::string& bytes) {
    std::ofstream stream(file, std::ios::binary);
    stream << bytes;
    if (!stream) throw std::runtime_error("cannot write " + file.string());
}

// The first byte tells the target which reader is meant.
void write_for_reader(const fs::path& file, char reader, const fs::path& mesh) {
    std::ifstream stream(mesh, std::ios::binary);
    write(file, reader + std::string(std::istreambuf_iterator<char>(stream), {}));
}

// In the order of mesh_fuzz.cpp.
char reader_of(const fs::path& mesh) {
    constexpr std::string_view endings[] = {".ply", ".obj", ".off", ".stl", ".gltf", ".glb", ".vtp", ".mtl"};
    return static_cast<char>(std::find(std::begin(endings), std::end(endings), mesh.extension()) - std::begin(endings));
}

void make_meshes(const fs::path& folder) {
    const Mesh mesh = shapes::with_attributes(shapes::icosphere(1));
    for (const std::string ending : {".ply", ".obj", ".glb", ".vtp"}) {
        const fs::path plain = folder / ("plain" + ending);
        expect(meshio::write_mesh(plain, mesh.view()));
        write_for_reader(folder / ("mesh" + ending), reader_of(plain), plain);
        fs::remove(plain);
    }
    if (const std::string levels = mesh_files::compressed_glb(); !levels.empty())
        write(folder / "levels.glb", '\5' + levels);
    for (const auto& [name, bytes] : mesh_files::samples()) write(folder / name, reader_of(name) + bytes);
    write(folder / "mesh.gltf",
          "\4{\"asset\":{\"version\":\"2.0\"},\"buffers\":[{\"byteLength\":36,\"uri\":\"data:application/"
          "octet-stream;base64,"
          "AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA\"}],\"bufferViews\":[{\"buffer\":0,\"byteLength\":36}],"
          "\"accessors\":[{\"bufferView\":0,\"componentType\":5126,\"count\":3,\"type\":\"VEC3\"}],"
          "\"meshes\":[{\"primitives\":[{\"attributes\":{\"POSITION\":0}}]}],\"nodes\":[{\"mesh\":0}],\"scenes\":[{"
          "\"nodes\":[0]}]}");
    write(folder / "colours.mtl",
          "\7newmtl a\nKd 0.5 0.25 1\nd 0.5\nmap_Kd -s 2 2 1 -o 0 0 0 images/a.png\nnewmtl b\nKe 1 1 1\nTr 0.5\n"
          "map_Kd no\0path.png\n"s);
}

// Read as a scene: instances, a camera, lights.
void make_scene(const fs::path& folder) {
    const std::string json = mesh_files::gltf_triangle_json(
        R"([{"mesh":0,"name":"a","translation":[1,0,0],"children":[1]},{"mesh":0,"scale":[2,2,2]},)"
        R"({"camera":0,"rotation":[0,0.7071068,0,0.7071068]},)"
        R"({"extensions":{"KHR_lights_punctual":{"light":1}}}])",
        R"({"byteLength":42})",
        R"(,"cameras":[{"type":"perspective","perspective":{"yfov":0.5,"znear":0.1}}],)"
        R"("extensionsUsed":["KHR_lights_punctual"],"extensions":{"KHR_lights_punctual":{"lights":[)"
        R"({"type":"directional","intensity":3,"color":[1,0.5,0]},{"type":"spot","intensity":7,"range":4,)"
        R"("spot":{"innerConeAngle":0.2,"outerConeAngle":0.5}}]}})");
    write(folder / "scene.glb", '\4' + mesh_files::glb(json, mesh_files::gltf_triangle_data()));
}

void make_vtp(const fs::path& folder) {
    for (const auto& [name, bytes] : vtp_files::samples()) write(folder / name, reader_of(name) + bytes);
}

Mesh with_values(Mesh mesh) {
    std::vector<std::byte> values(4 * mesh.positions.size());
    for (std::size_t i = 0; i < values.size(); ++i) values[i] = static_cast<std::byte>(i * 31);
    const meshio::VertexArray numbers{.name = "n", .type = meshio::ValueType::int32, .values = values};
    const meshio::VertexArray reals{.name = "r", .type = meshio::ValueType::float32, .values = values};
    mesh.document = meshio::pack({.format = meshio::SourceDocument::Format::table, .arrays = {numbers, reals}});
    return mesh;
}

Mesh with_document(Mesh mesh) {
    mesh.ranges = {{"part", MeshRange::Kind::primitive, 0, mesh.triangles.size()}};
    const std::size_t vertices = mesh.positions.size();
    mesh.document = meshio::pack({.json = "{}",
                                  .files = {{.uri = "image.png"}},
                                  .parts = {{.node = 0, .mesh = 0, .primitive = 0, .channels = 1}},
                                  .runs = {{0, 0}},
                                  .channels = {{"TEXCOORD_0", 2, std::vector<float>(2 * vertices, 0.5f)}},
                                  .vertex_parts = std::vector<std::uint32_t>(vertices, 0)});
    return mesh;
}

void make_trees(const fs::path& folder) {
    const std::pair<const char*, Mesh> meshes[] = {{"ball", shapes::bumpy_sphere(1)},
                                                   {"open", shapes::grid(4)},
                                                   {"locked", shapes::placed(shapes::grid(4), 0.1, {0.3, 1, 2})},
                                                   {"triangle", shapes::single_triangle()},
                                                   {"attributes", shapes::with_attributes(shapes::icosphere(1))},
                                                   {"document", with_document(shapes::icosphere(1))},
                                                   {"values", with_values(shapes::icosphere(1))},
                                                   {"box", shapes::cube(2)}, // with wedges at its edges
                                                   {"box_document", with_document(shapes::cube(2))},
                                                   {"box_values", with_values(shapes::cube(2))}};
    for (const auto& [name, mesh] : meshes) {
        const bool is_locked = std::string_view(name) == "locked";
        const auto tree = build_tree(mesh.view(), {.border_weight = is_locked ? never_folds : 1});
        if (!tree) throw std::runtime_error(tree.error().message);
        expect(write_tree(folder / (std::string(name) + ".vdt"), *tree));
        const auto marked = tree->with_attribute("mark", AttributeDomain::interior_node,
                                                 std::vector<float>(tree->interior_count(), 0.5f));
        if (!marked) throw std::runtime_error(marked.error().message);
        expect(write_tree(folder / (std::string(name) + "_marked.vdt"), *marked));
    }
}

void make_drives(const fs::path& folder) {
    std::mt19937 random(1);
    for (int i = 0; i < 8; ++i) {
        std::string bytes(256 << (i % 4), '\0');
        for (char& byte : bytes) byte = static_cast<char>(random());
        write(folder / std::to_string(i), bytes);
    }
}

void make_images(const fs::path& folder) {
    unseen::perception::Image grey{5, 4, 1, std::vector<float>(20, 0.25f)},
        colours{3, 2, 3, std::vector<float>(18, 0.5f)};
    for (const char* ending : {".png", ".pfm", ".exr"}) {
        expect(unseen::perception::write_image(folder / ("grey" + std::string(ending)), grey));
        expect(unseen::perception::write_image(folder / ("colours" + std::string(ending)), colours));
    }
    write(folder / "colours.jpg", unseen::support::jpeg(colours));
}

// The first byte chooses the reader: see text_fuzz.cpp.
void make_texts(const fs::path& folder) {
    namespace calibration = unseen::calibration;
    const fs::path data = UNSEEN_DATA, plain = folder / "plain";
    const auto keep = [&](const std::string& name, char reader) { write_for_reader(folder / name, reader, plain); };
    write_for_reader(folder / "display.json", '\0', data / "displays/headset-1832x1920.json");
    const auto& standard = unseen::perception::CsfTable::standard();
    calibration::CalibrationPlan plan;
    plan.places = {{2, 0}, {4, 5}};
    auto procedure = calibration::Procedure::create(plan, standard);
    if (!procedure) throw std::runtime_error(procedure.error().message);
    static_cast<void>(procedure->next());
    procedure->choose(1);
    expect(procedure->save(plain));
    keep("procedure.json", '\4');
    const auto table = [](const std::string& version, const std::string& more) {
        return "{\"format\": \"unseen-csf\", \"version\": " + version +
               ", \"frequency_cpd\": [1, 16], \"eccentricity_deg\": [0, 10], \"luminance_cdm2\": [3, 100], "
               "\"sensitivity\": [[[60, 5], [120, 10]], [[30, 0.5], [50, 1.5]]]" +
               more + "}";
    };
    write(folder / "csf.json", "\1" + table("1", ""));
    write(folder / "observer.json",
          "\2" + table("3",
                       ", \"observer\": \"a\", \"date\": \"2024-01-31\", \"method\": \"m\", \"display\": \"d\", "
                       "\"conditions\": \"c\", \"measured_at_cdm2\": 100, \"measured\": [[4, 0, 80, 60, 100, 20]], "
                       "\"measured_wide\": [[4, 0, 9, 80, 60, 100, 20]], \"summation\": [1.1, 1, 1.2]"));
    write(folder / "lights.json",
          "\3{\"ambient\": 0.1, \"material\": {\"specular\": 0.04, \"shininess\": 40}, \"lights\": [{\"type\": "
          "\"spot\", \"position\": [0, 3, 0], \"direction\": [0, -1, 0], \"inner_degrees\": 20, "
          "\"outer_degrees\": 30, \"intensity\": 1, \"distance\": 3, \"shadow\": true}, {\"type\": \"point\", "
          "\"position\": [1, 2, 3], \"intensity\": 0.5, \"distance\": 3, \"keyframes\": [{\"time_s\": 0, "
          "\"position\": [1, 2, 3]}]}]}");
    write(folder / "sensitivities.csv", "\5dataset,frequency_cpd,temporal_hz,eccentricity_deg,luminance_cdm2,area_deg2,"
                                        "sensitivity\na,2,0,0,50,1,100\n");
    calibration::Study study{.pixels_per_degree = 30};
    study.pairs.push_back({"x", folder / "a.png", folder / "b.png", false, true});
    expect(calibration::write_study(plain, study));
    keep("study.json", '\6');
    const auto trials = calibration::trials_of(study, "ann");
    const calibration::StudyAnswer answer{trials.front(), calibration::StudyChoice::left, 1.5};
    expect(calibration::write_answers(plain, study, "ann", std::span(&answer, 1)));
    keep("answers.csv", '\7');
    for (const auto& entry : fs::directory_iterator(data / "gaze"))
        write_for_reader(folder / entry.path().filename(), '\10', entry.path());
    write(folder / "path.csv",
          "\11eye_x,eye_y,eye_z,target_x,target_y,target_z,gaze_x,gaze_y\n0,0,5,0,0,0,3,4\n1,0,5,0,0,"
          "0,3,4\n");
    write(folder / "photometer.csv", "\12code,cdm2\n# of a display\n0,0.5\n128,20\n255,100\n");
    fs::remove(plain);
}

// The first byte chooses the reader: see selection_fuzz.cpp.
void make_selections(const fs::path& folder) {
    namespace session = unseen::session;
    session::Selections::Data selections;
    selections.budget = 1000;
    selections.triangles = {{900, 300, 100}, {80}};
    const auto corner_at = [&](const session::LatticePoint& place) {
        session::SelectionCorner corner{place, {}};
        corner.cameras.resize(static_cast<std::size_t>(selections.directions()));
        corner.cameras.front().objects = {{0, 1, {0.5f, 2}}, {1, 0, {}}};
        return corner;
    };
    const fs::path plain = folder / "plain", journal_file = folder / "journal_plain";
    auto journal = session::SelectionJournal::open(journal_file, 0x3131313131313131);
    if (!journal) throw std::runtime_error(journal.error().message);
    for (const session::LatticePoint& place : {session::LatticePoint{0, 0, 0}, session::LatticePoint{0, 0, 1},
                                               session::LatticePoint{1, 0, 0}, session::LatticePoint{1, 0, 1}}) {
        selections.corners.push_back(corner_at(place));
        expect(journal->add(selections.corners.back()));
    }
    selections.cells = {{{0, 0, 0}, 1}};
    expect(session::write_selections(plain, selections));
    write_for_reader(folder / "small.sel", '\0', plain);
    write_for_reader(folder / "sealed.sel", '\1', plain);
    const auto message = session::to_bytes(selections.corners.front());
    write(folder / "message", '\2' + std::string(reinterpret_cast<const char*>(message.data()), message.size()));
    write_for_reader(folder / "journal", '\3', journal_file);
    fs::remove(plain);
    fs::remove(journal_file);
}

} // namespace

int main(int count, char** arguments) try {
    if (count != 2) throw std::runtime_error("usage: make_fuzz_seeds FOLDER");
    const fs::path folder = arguments[1];
    for (const char* target : {"mesh", "tree", "follow", "image", "text", "selection"})
        fs::create_directories(folder / target);
    make_meshes(folder / "mesh");
    make_scene(folder / "mesh");
    make_vtp(folder / "mesh");
    make_trees(folder / "tree");
    make_drives(folder / "follow");
    make_images(folder / "image");
    make_texts(folder / "text");
    make_selections(folder / "selection");
} catch (const std::exception& error) {
    std::fprintf(stderr, "make_fuzz_seeds: %s\n", error.what());
    return 1;
}
