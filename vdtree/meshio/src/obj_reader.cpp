// Wavefront OBJ: polygons with positions, UVs, normals, smoothing groups, groups and material names. Two passes over the text: vertices
// first, so that polygons can be cut by their positions, then faces.
#include "mesh_readers.h"
#include "mtl_reader.h"
#include "polygon_triangulator.h"
#include "text_scanner.h"
#include "weld.h"
#include <unseen/vdtree/internal/vectors.h>

#include <unordered_map>

namespace unseen::meshio {

namespace fs = std::filesystem;

namespace {

constexpr Index none = std::numeric_limits<Index>::max(); // a corner without UV or normal
constexpr std::int64_t most_smoothing = std::numeric_limits<Index>::max();
constexpr const char* too_many_vertices = "it has more vertices than 32-bit indices can number; split the mesh.";
// Statements of surfaces, curves, display and grouping that change no triangle.
constexpr std::string_view ignored_keywords[] = {
    "l",         "p",      "vp",     "mg",     "lod",  "bevel", "c_interp", "d_interp", "shadow_obj",
    "trace_obj", "maplib", "usemap", "cstype", "deg",  "bmat",  "step",     "curv",     "curv2",
    "surf",      "parm",   "trim",   "hole",   "scrv", "sp",    "end",      "con",      "ctech",
    "stech",     "call",   "csh",    "cdc",    "cdp",  "bzp",   "bsp",      "res"};

struct Corner {
    Index position = none;
    Index uv = none;
    Index normal = none;
    bool operator==(const Corner&) const = default;
};

// Seeded, because a file could be made to have all its corners in one bucket.
struct CornerHash {
    SeededHash seeded = SeededHash::random();
    std::size_t operator()(const Corner& c) const {
        return static_cast<std::size_t>(SeededHash(seeded).add(c.position).add(c.uv).add(c.normal).value());
    }
};

// For each value the number of the first equal one, so that equal attributes are not told apart by their numbers.
template <class Vector>
std::vector<Index> first_equal(const std::vector<Vector>& values) {
    const std::span<const Vector> all(values);
    return find_first_same(
        values.size(), [&](SeededHash& hash, std::size_t i) { add_bits(hash, all, i); },
        [&](std::size_t a, std::size_t b) { return has_same_bits(all, a, b); });
}

// Gives every combination of position, UV and normal a vertex: the first one of a position its own number, so that
// the numbering of the file stays; the others numbers behind the last position.
class VertexTable {
public:
    VertexTable(std::size_t position_count, const std::vector<glm::vec2>& uvs, const std::vector<glm::vec3>& normals)
        : first_(position_count), first_uv_(first_equal(uvs)), first_normal_(first_equal(normals)),
          next_(position_count) {}

    // The vertex of a corner.
    Index find(Corner corner) {
        if (corner.uv != none) corner.uv = first_uv_[corner.uv];
        if (corner.normal != none) corner.normal = first_normal_[corner.normal];
        Corner& first = first_[corner.position];
        if (first.position == none) first = corner;
        if (first == corner) return corner.position;
        const auto [found, is_new] = others_.try_emplace(corner, static_cast<Index>(next_));
        if (is_new) {
            if (next_++ >= none) fail_unsupported(too_many_vertices);
            added_.push_back(corner);
        }
        return found->second;
    }

    const std::vector<Corner>& first() const { return first_; } // position none: in no face
    const std::vector<Corner>& added() const { return added_; }

private:
    std::vector<Corner> first_;
    std::vector<Index> first_uv_;
    std::vector<Index> first_normal_;
    std::unordered_map<Corner, Index, CornerHash> others_;
    std::vector<Corner> added_;
    std::uint64_t next_;
};

// Lines with comments removed and those that end in a backslash joined with the next.
class StatementScanner {
public:
    explicit StatementScanner(std::string_view text) : lines_(text) {}

    bool next(std::string_view& keyword, std::string_view& rest) {
        while (lines_.next(rest)) {
            line_ = lines_.line();
            keyword = take_word(rest);
            if (keyword.empty() || keyword.front() == '#') continue;
            if (trimmed(rest).ends_with('\\')) rest = join(rest);
            return true;
        }
        return false;
    }

    std::uint64_t line() const { return line_; } // where the statement starts
    std::size_t position() const { return lines_.position(); }

private:
    std::string_view join(std::string_view rest) {
        joined_.clear();
        for (;;) {
            rest = trimmed(rest);
            const bool goes_on = rest.ends_with('\\');
            if (goes_on) rest.remove_suffix(1);
            joined_.append(rest);
            joined_ += ' ';
            if (!goes_on || !lines_.next(rest)) return joined_;
        }
    }

    LineScanner lines_;
    std::uint64_t line_ = 0;
    std::string joined_;
};

// Parses up to `limit` numbers; -1 where a word is none or there are more. A comment may follow.
int parse_numbers(std::string_view line, double* numbers, int limit) {
    const char* at = line.data();
    const char* const end = at + line.size();
    int count = 0;
    for (;;) {
        while (at != end && is_blank(*at)) ++at;
        if (at == end || *at == '#') return count;
        if (count == limit) return -1;
        at = parse_number(at, end, numbers[count]);
        if (at == nullptr || (at != end && !is_blank(*at))) return -1;
        ++count;
    }
}

class ObjReader {
public:
    explicit ObjReader(const MeshSource& source) : source_(source) {}

    ReadResult read() {
        if (const std::size_t nul = source_.bytes.find('\0'); nul != std::string_view::npos)
            fail("line ", line_number(source_.bytes, nul),
                 ": a NUL byte, which no OBJ text contains; the file is damaged or no OBJ file.");
        read_vertices();
        read_faces();
        add_attributes();
        add_warnings();
        keep_materials();
        keep_document();
        return std::move(result_);
    }

private:
    // Calls read(keyword, rest) for each statement of the file. `done`: bytes that were read before.
    template <class Read>
    void for_each_statement(std::size_t done, Read&& read) {
        StatementScanner statements(source_.bytes);
        std::string_view keyword, rest;
        while (statements.next(keyword, rest)) {
            line_ = statements.line();
            read(keyword, rest);
            source_.report_row(++statements_, done + statements.position() / 2, "reading OBJ");
        }
    }

    template <class... Parts>
    [[noreturn]] void fail_here(const Parts&... parts) const {
        fail("line ", line_, ": ", parts...);
    }

    // ---- first pass ----

    void read_vertices() {
        for_each_statement(0, [&](std::string_view keyword, std::string_view rest) {
            if (keyword == "v") add_position(rest);
            else if (keyword == "vt") add_uv(rest);
            else if (keyword == "vn") add_normal(rest);
        });
        if (std::max({positions().size(), uvs_.size(), normals_.size()}) >= none) fail_unsupported(too_many_vertices);
    }

    // v X Y Z [W], v X Y Z R G B or v X Y Z R G B A. W weighs control points of curves and is of no use here.
    void add_position(std::string_view rest) {
        std::array<double, 7> n{};
        const int count = parse_numbers(rest, n.data(), 7);
        if (count != 3 && count != 4 && count != 6 && count != 7)
            fail_here("vertex ", positions().size() + 1, " needs 3 numbers, or 6 with a colour; correct ",
                      in_quotes(trimmed(rest)), ".");
        positions().emplace_back(n[0], n[1], n[2]);
        check_position(result_.bad, positions().back(),
                       [&] { return text_of("line ", line_, ": vertex ", positions().size()); });
        if (count < 6) return;
        colours_.resize(positions().size() - 1, missing_colour);
        colours_.push_back(
            decode_colour(glm::vec4(n[3], n[4], n[5], count == 7 ? n[6] : 1.0), source_.options.colours));
    }

    void add_uv(std::string_view rest) {
        std::array<double, 3> n{};
        if (parse_numbers(rest, n.data(), 3) < 1)
            fail_here("a texture coordinate needs 1 to 3 numbers; correct ", in_quotes(trimmed(rest)), ".");
        uvs_.emplace_back(n[0], n[1]);
    }

    void add_normal(std::string_view rest) {
        std::array<double, 3> n{};
        if (parse_numbers(rest, n.data(), 3) != 3)
            fail_here("a normal needs 3 numbers; correct ", in_quotes(trimmed(rest)), ".");
        normals_.emplace_back(n[0], n[1], n[2]);
    }

    // ---- second pass ----

    void read_faces() {
        for_each_statement(source_.bytes.size() / 2, [&](std::string_view keyword, std::string_view rest) {
            if (keyword == "v") {
                ++positions_seen_;
            } else if (keyword == "vt") {
                ++uvs_seen_;
            } else if (keyword == "vn") {
                ++normals_seen_;
            } else if (keyword == "f" || keyword == "fo") { // fo: what f was called before version 3
                add_face(rest);
            } else if (keyword == "g" || keyword == "o") {
                start_range(group_, rest, MeshRange::Kind::group);
                change_part(keyword == "g" ? &SourceDocument::Part::group : &SourceDocument::Part::object, rest);
            } else if (keyword == "s") {
                change_smoothing(rest);
            } else if (keyword == "mtllib") {
                read_materials(rest);
            } else if (keyword == "usemtl") {
                start_range(material_, rest, MeshRange::Kind::material);
                change_part(&SourceDocument::Part::material, rest);
            } else if (std::ranges::find(ignored_keywords, keyword) == std::end(ignored_keywords) && unknown_++ == 0) {
                first_unknown_ = text_of(in_quotes(keyword), " in line ", line_);
            }
        });
        end_range(group_);
        end_range(material_);
        if (states_smoothing_) result_.mesh.smoothing.resize(triangle_corners_.size() / 3, smoothing_);
        std::stable_sort(ranges().begin(), ranges().end(),
                         [](const MeshRange& a, const MeshRange& b) { return a.first_triangle < b.first_triangle; });
    }

    void add_face(std::string_view rest) {
        corners_.clear();
        is_whole_ = true;
        const char* at = rest.data();
        const char* const end = at + rest.size();
        for (;;) {
            while (at != end && is_blank(*at)) ++at;
            if (at == end || *at == '#') break;
            corners_.push_back(parse_corner(at, end));
        }
        ++result_.source_faces;
        if (!is_whole_) return;
        if (corners_.size() < 3) {
            ++small_faces_;
            return;
        }
        points_.clear();
        for (const Corner& corner : corners_) points_.push_back(positions()[corner.position]);
        if (result_.bad.vertices > 0 && !std::all_of(points_.begin(), points_.end(), is_finite<double>)) {
            ++result_.bad.left_out;
            return;
        }
        begin_triangle();
        auto& [has_normals, has_uvs] = part_attributes_[document_.runs.back().part];
        for (const Corner& corner : corners_) {
            has_normals = has_normals || corner.normal != none;
            has_uvs = has_uvs || corner.uv != none;
        }
        for (const Triangle& triangle : polygons_.cut(points_))
            for (const Index corner : triangle) triangle_corners_.push_back(corners_[corner]);
    }

    // V, V/T, V//N or V/T/N; the numbers may be left out after a slash.
    Corner parse_corner(const char*& at, const char* end) {
        const char* const start = at;
        const char* const word_end = std::find_if(at, end, is_blank);
        const auto check = [&](bool is_corner) {
            if (!is_corner)
                fail_here("a corner of the face is ", in_quotes({start, word_end}),
                          " and should be like 1, 1/2, 1//3 or 1/2/3; correct it.");
        };
        Corner corner;
        std::int64_t number = 0;
        at = parse_number(at, word_end, number);
        check(at != nullptr);
        if (!resolve(number, positions_seen_, positions().size(), corner.position) && is_whole_) {
            is_whole_ = false;
            leave_out_face(result_.bad, [&] {
                return text_of("line ", line_, ": face ", result_.source_faces + 1, " uses vertex ", number,
                               ", but there are ", number < 0 ? positions_seen_ : positions().size(),
                               number == 0  ? ", numbered from 1"
                               : number < 0 ? " before it"
                                            : "");
            });
        }
        for (int slash = 0; slash < 2 && at != word_end && *at == '/'; ++slash) {
            ++at;
            if (at == word_end || *at == '/') continue;
            at = parse_number(at, word_end, number);
            check(at != nullptr);
            const bool is_there = slash == 0 ? resolve(number, uvs_seen_, uvs_.size(), corner.uv)
                                             : resolve(number, normals_seen_, normals_.size(), corner.normal);
            if (!is_there && lost_attributes_++ == 0)
                first_lost_attribute_ =
                    text_of(slash == 0 ? "texture coordinate " : "normal ", number, " in line ", line_);
        }
        check(at == word_end);
        has_uvs_ = has_uvs_ || corner.uv != none;
        has_normals_ = has_normals_ || corner.normal != none;
        return corner;
    }

    // Positive numbers count from 1 in the file, negative ones back from the last that came before the face. False if
    // there is no such one.
    static bool resolve(std::int64_t number, std::size_t seen, std::size_t total, Index& index) {
        const bool is_valid = number > 0 ? static_cast<std::uint64_t>(number) <= total
                                         : number < 0 && number >= -static_cast<std::int64_t>(seen);
        if (is_valid) index = static_cast<Index>(number > 0 ? number - 1 : static_cast<std::int64_t>(seen) + number);
        return is_valid;
    }

    // s N, s off or s 0. Faces before the first one are flat, as the format says, but where there is none nothing is known.
    void change_smoothing(std::string_view rest) {
        const std::string_view word = take_word(rest);
        const char* const end = word.data() + word.size();
        std::int64_t number = 0;
        const bool is_off = equals_ignoring_case(word, "off");
        if (!is_off &&
            (word.empty() || parse_number(word.data(), end, number) != end || number < 0 || number > most_smoothing)) {
            if (lost_smoothing_++ == 0) first_lost_smoothing_ = text_of(in_quotes(word), " in line ", line_);
            return;
        }
        result_.mesh.smoothing.resize(triangle_corners_.size() / 3, smoothing_);
        states_smoothing_ = true;
        smoothing_ = static_cast<Index>(number);
    }

    // ---- groups and materials ----

    // One name with blanks in it, or several.
    void read_materials(std::string_view rest) {
        rest = trimmed(rest);
        if (rest.empty() || read_library(rest, rest.find_first_of(" \t") == rest.npos)) return;
        while (!(rest = trimmed(rest)).empty()) read_library(take_word(rest), true);
    }

    // False if it is not there; warns of that only if it must be.
    bool read_library(std::string_view name, bool must_be_there) {
        if (libraries_.contains(std::string(name))) return true; // it is often named again and again
        const NamedFile library = files_.find(name);
        if (!library.bytes && !must_be_there) return false;
        libraries_.emplace(name);
        if (!library.bytes)
            warn(text_of("line ", line_, ": the materials of a library were left out: ") + library.why + ".");
        else has_library_ = true;
        if (library.uri.empty()) return true;
        const fs::path folder = fs::path(library.uri).parent_path();
        std::shared_ptr<const std::string> text;
        if (library.bytes)
            text = std::make_shared<const std::string>(read_mtl(
                *library.bytes, (source_.folder / library.uri).string(),
                [&](std::string_view image) { return files_.find(image, folder); }, folder, library_));
        document_.files.push_back(
            {.use = SourceDocument::File::Use::library, .uri = library.uri, .bytes = std::move(text)});
        return true;
    }

    // ---- what is kept beside the triangles ----

    // From the next triangle on.
    void change_part(std::string SourceDocument::Part::*name, std::string_view rest) {
        part_.*name = trimmed(rest);
        has_parts_ = has_parts_ || (name != &SourceDocument::Part::group && !(part_.*name).empty());
        part_changes_ = true;
    }

    void begin_triangle() {
        if (!part_changes_) return;
        part_changes_ = false;
        const auto [found, is_new] = part_numbers_.try_emplace(std::array{part_.object, part_.group, part_.material},
                                                               static_cast<std::uint32_t>(document_.parts.size()));
        if (is_new) document_.parts.push_back(part_);
        if (is_new) part_attributes_.emplace_back();
        document_.runs.push_back({triangle_corners_.size() / 3, found->second});
    }

    void keep_materials() {
        for (Message& warning : library_.warnings) warn(std::move(warning));
        result_.materials = std::move(library_.materials);
        if (!source_.options.images) {
            for (Material& material : result_.materials) {
                for (auto* const bytes :
                     {&material.image_bytes, &material.normal_map, &material.emission_map, &material.opacity_map})
                    bytes->reset();
                material.image.clear();
            }
            return;
        }
        warn_of_lost_images(library_.lost, ranges(), result_.warnings);
        warn_of_undrawn(result_);
        std::set<std::string> textured;
        for (const Material& material : result_.materials)
            if (material.has_image() || material.normal_map || material.opacity_map || material.emission_map)
                textured.insert(material.name);
        std::uint64_t bare = 0;
        for (const MeshRange& range : ranges()) {
            if (range.kind != MeshRange::Kind::material || !textured.contains(range.name)) continue;
            for (std::uint64_t t = range.first_triangle; t < range.first_triangle + range.triangle_count; ++t)
                bare += std::any_of(&triangle_corners_[3 * t], &triangle_corners_[3 * t] + 3,
                                    [](const Corner& corner) { return corner.uv == none; });
        }
        warn_of_missing_uvs(bare, result_);
    }

    void keep_document() {
        if (!has_parts_ || result_.mesh.triangles.empty()) return;
        if (ranges().empty()) ranges().push_back({"", MeshRange::Kind::group, 0, result_.mesh.triangles.size()});
        document_.format = SourceDocument::Format::obj;
        for (const NamedFile& image : library_.images)
            document_.files.push_back({.uri = image.uri, .bytes = image.bytes});
        const Mesh& mesh = result_.mesh;
        const auto keep = [&](const char* name, int components, const auto& values, auto&& has_part) {
            if (values.empty()) return;
            SourceDocument::Channel channel{name, static_cast<std::uint32_t>(components), {}};
            channel.values.reserve(values.size() * channel.components);
            for (const auto& value : values)
                for (int k = 0; k < components; ++k) channel.values.push_back(value[k]);
            for (std::size_t part = 0; part < document_.parts.size(); ++part)
                if (has_part(part_attributes_[part]))
                    document_.parts[part].channels |= std::uint32_t{1} << document_.channels.size();
            document_.channels.push_back(std::move(channel));
        };
        keep("NORMAL", 3, mesh.normals, [](PartAttributes of) { return of.has_normals; });
        keep("TEXCOORD_0", 2, mesh.uvs, [](PartAttributes of) { return of.has_uvs; });
        keep("COLOR_0", 4, mesh.colours, [](PartAttributes) { return true; });
        result_.document = std::move(document_);
    }

    struct OpenRange {
        MeshRange range;
        bool is_open = false;
    };

    void start_range(OpenRange& open, std::string_view name, MeshRange::Kind kind) {
        end_range(open);
        name = trimmed(name);
        open.is_open = !name.empty();
        open.range = {std::string(name), kind, triangle_corners_.size() / 3, 0};
    }

    void end_range(OpenRange& open) {
        open.range.triangle_count = triangle_corners_.size() / 3 - open.range.first_triangle;
        if (open.is_open && open.range.triangle_count > 0) ranges().push_back(std::move(open.range));
        open.is_open = false;
    }

    // ---- vertices with attributes ----

    void add_attributes() {
        Mesh& mesh = result_.mesh;
        mesh.triangles.resize(triangle_corners_.size() / 3);
        if (!has_uvs_ && !has_normals_)
            for (std::size_t i = 0; i < triangle_corners_.size(); ++i)
                mesh.triangles[i / 3][i % 3] = triangle_corners_[i].position;
        else split_vertices();
        if (!colours_.empty()) colours_.resize(mesh.positions.size(), missing_colour);
        mesh.colours = std::move(colours_);
    }

    void split_vertices() {
        Mesh& mesh = result_.mesh;
        result_.source_vertices = mesh.positions.size();
        VertexTable table(mesh.positions.size(), uvs_, normals_);
        for (std::size_t i = 0; i < triangle_corners_.size(); ++i)
            mesh.triangles[i / 3][i % 3] = table.find(triangle_corners_[i]);
        const std::size_t vertices = mesh.positions.size() + table.added().size();
        if (has_uvs_) mesh.uvs.reserve(vertices);
        if (has_normals_) mesh.normals.reserve(vertices);
        for (const Corner& corner : table.first()) append_attributes(corner);
        mesh.positions.reserve(vertices);
        if (!colours_.empty()) {
            colours_.resize(mesh.positions.size(), missing_colour);
            colours_.reserve(vertices);
        }
        for (const Corner& corner : table.added()) {
            mesh.positions.push_back(glm::dvec3(mesh.positions[corner.position]));
            if (!colours_.empty()) colours_.push_back(glm::vec4(colours_[corner.position]));
            append_attributes(corner);
        }
    }

    void append_attributes(const Corner& corner) {
        Mesh& mesh = result_.mesh;
        if (has_uvs_) mesh.uvs.push_back(corner.uv == none ? glm::vec2(0.0f) : uvs_[corner.uv]);
        if (has_normals_) mesh.normals.push_back(corner.normal == none ? missing_normal : normals_[corner.normal]);
    }

    void add_warnings() {
        if (small_faces_ > 0) warn(counted_were(small_faces_, "face") + " left out for having fewer than 3 corners.");
        if (unknown_ > 0)
            warn(counted_were(unknown_, "line") + " skipped for an unknown keyword, the first " + first_unknown_ + ".");
        if (lost_attributes_ > 0)
            warn(text_of(lost_attributes_, lost_attributes_ == 1 ? " corner goes" : " corners go",
                         " without a normal or texture coordinate that is not there, the first ", first_lost_attribute_,
                         "."));
        if (lost_smoothing_ > 0)
            warn(counted_were(lost_smoothing_, "smoothing group") + " neither a number nor off, the first " +
                 first_lost_smoothing_ + "; faces stay in the group before.");
        if (has_library_) warn_of_unknown_materials();
        if (const auto fanned = polygons_.fanned_concave(); fanned > 0)
            warn(counted_were(fanned, "intricate concave polygon") + " cut into a fan.");
    }

    void warn_of_unknown_materials() {
        std::set<std::string> known, unknown;
        for (const Material& material : library_.materials) known.insert(material.name);
        for (const MeshRange& range : ranges())
            if (range.kind == MeshRange::Kind::material && !known.contains(range.name)) unknown.insert(range.name);
        if (!unknown.empty())
            warn(text_of(unknown.size(), unknown.size() == 1 ? " material is" : " materials are",
                         " in no library that was read, the first ", in_quotes(*unknown.begin()),
                         "; its faces are left as they are."));
    }

    void warn(Message sentence) { result_.warnings.push_back(std::move(sentence)); }
    std::vector<glm::dvec3>& positions() { return result_.mesh.positions; }
    std::vector<MeshRange>& ranges() { return result_.mesh.ranges; }

    const MeshSource& source_;
    ReadResult result_;
    std::vector<glm::vec4> colours_; // up to the last vertex that has one
    std::vector<glm::vec2> uvs_;
    std::vector<glm::vec3> normals_;
    std::size_t positions_seen_ = 0;
    std::size_t uvs_seen_ = 0;
    std::size_t normals_seen_ = 0;
    std::vector<Corner> corners_;          // of the present face
    std::vector<glm::dvec3> points_;       // their positions
    std::vector<Corner> triangle_corners_; // three a triangle
    bool is_whole_ = true;                 // all that the face uses is there
    bool has_uvs_ = false;
    bool has_normals_ = false;
    Index smoothing_ = 0; // group of the next triangle
    bool states_smoothing_ = false;
    OpenRange group_, material_;
    NamedFiles files_{source_};
    std::set<std::string> libraries_; // that were asked for
    bool has_library_ = false;        // that could be read
    MtlContents library_;
    SourceDocument document_;
    SourceDocument::Part part_; // of the next triangle
    struct PartAttributes {
        bool has_normals = false, has_uvs = false;
    };
    std::vector<PartAttributes> part_attributes_;
    std::map<std::array<std::string, 3>, std::uint32_t> part_numbers_;
    bool part_changes_ = true; // since the last triangle
    bool has_parts_ = false;   // by objects or materials
    PolygonTriangulator polygons_;
    std::uint64_t statements_ = 0, line_ = 0;
    std::uint64_t small_faces_ = 0;
    std::uint64_t unknown_ = 0, lost_attributes_ = 0, lost_smoothing_ = 0;
    std::string first_unknown_, first_lost_attribute_, first_lost_smoothing_;
};

} // namespace

ReadResult read_obj(const MeshSource& source) { return ObjReader(source).read(); }

} // namespace unseen::meshio
