// The file format .vdt: a header, a table of sections, the checksums of their pages, and the sections themselves.
// docs/file-format.md describes it byte by byte.
#include <unseen/vdtree/tree_io.h>

#include <fstream>

#define XXH_INLINE_ALL
#include <xxhash.h>

#include <unseen/vdtree/internal/atomic_file.h>

#include "files/mapped_file.h"
#include "tree/mask_pool.h"
#include "tree/node_check.h"
#include <unseen/vdtree/internal/tree_shape.h>
#include <unseen/vdtree/internal/vertex_tree_data.h>

namespace unseen::vdtree {

namespace {

constexpr std::array<char, 8> magic = {'U', 'N', 'S', 'E', 'E', 'N', 'V', 'T'};
constexpr std::uint32_t format_version = 7;
constexpr std::uint64_t page_bytes = 1 << 20;
constexpr std::uint32_t most_sections = 64;     // the tree's own, and most_attributes
constexpr std::uint64_t section_alignment = 64; // bytes; a cache line, and what any mapped element needs

static_assert(std::endian::native == std::endian::little, "The file holds the arrays as they are in memory.");

struct Header {
    std::array<char, 8> magic;
    std::uint32_t version;
    std::uint32_t section_count;
    std::uint64_t file_bytes;
    std::uint64_t page_count;      // over all sections
    std::uint64_t table_checksum;  // of the section table and the page checksums
    std::uint64_t header_checksum; // of the fields above
};
static_assert(sizeof(Header) == 48);

struct Section {
    std::array<char, 20> name;
    std::uint32_t domain; // an AttributeDomain; part_of_tree: one of the tree's own arrays
    std::uint32_t element_bytes;
    std::uint32_t component_bytes; // of the numbers in an element, for readers of another byte order
    std::uint64_t count;
    std::uint64_t offset;
};
static_assert(sizeof(Section) == 48 && longest_attribute_name == std::tuple_size_v<decltype(Section::name)>);
constexpr std::uint32_t part_of_tree = 0;

std::string_view name_of(const Section& s) { return {s.name.data(), strnlen(s.name.data(), s.name.size())}; }

// What is not an array.
struct Facts {
    double origin[3];
    float bounding_sphere[4];
    float light[4];
    float luminance_range[2];
    std::uint64_t dropped_triangles;
    std::uint32_t closedness;
    std::uint32_t prelit;
    float fill;
    std::uint32_t source_vertices;
    std::uint32_t crease_source;
    float crease_degrees;
};
static_assert(sizeof(Facts) == 96);

std::uint64_t checksum(const void* data, std::size_t bytes) { return XXH3_64bits(data, bytes); }

std::uint64_t pages_of(const Section& s) { return (s.count * s.element_bytes + page_bytes - 1) / page_bytes; }

// Walks every stored array of a tree, in file order: f(name, vector).
template <class Geometry, class Luminance, class F>
void for_each_array(Geometry& g, Luminance& l, F&& f) {
    f("parents", g.parents);
    f("several", g.several);
    f("extra_wedges", g.extra_wedges);
    f("further", g.further);
    f("leaf_ranks", g.leaf_ranks);
    f("wedge_ranks", g.wedge_ranks);
    f("positions", g.positions);
    f("normals", g.normals);
    f("colours", g.colours);
    f("uvs", g.uvs);
    f("luminance", l.luminance);
    f("first_leaf", g.first_leaf);
    f("leaf_end", g.leaf_end);
    f("subtree_end", g.subtree_end);
    f("first_triangle", g.first_triangle);
    f("bounds", g.bounds);
    f("support_spheres", g.support_spheres);
    f("mask_at", g.mask_at);
    f("mask_records", g.mask_records);
    f("displacement", g.displacement);
    f("fold_weights", g.fold_weights);
    f("support_range", l.support_range);
    f("ring_range", l.ring_range);
    f("adaptation", l.adaptation);
    f("triangles", g.triangles);
    f("needing", g.needing);
    f("first_need", g.first_need);
    f("needs", g.needs);
    f("source_triangles", g.source_triangles);
    f("source_vertices", g.source_vertices);
    f("locked_positions", g.locked_positions);
    f("document", g.document);
    f("texture", g.texture);
    f("texels", g.texels);
    f("emission", g.emission);
    f("relief", g.relief);
    f("blends", g.blends);
    f("ring_texture", g.ring_texture);
}

bool is_of_texture(std::string_view name) {
    return name == "texture" || name == "texels" || name == "emission" || name == "relief" || name == "blends" ||
           name == "ring_texture";
}

// Sections that are there only where they have elements.
bool is_of_seams(std::string_view name) {
    return name == "several" || name == "extra_wedges" || name == "further" || name == "leaf_ranks" ||
           name == "wedge_ranks";
}
bool is_of_needs(std::string_view name) { return name == "needing" || name == "first_need" || name == "needs"; }
bool is_optional(std::string_view name) {
    return is_of_texture(name) || is_of_seams(name) || is_of_needs(name) || name == "document" ||
           name == "fold_weights" || name == "locked_positions";
}

template <class T>
constexpr std::uint32_t component_bytes() {
    if constexpr (std::is_arithmetic_v<T>) return sizeof(T);
    else if constexpr (std::is_same_v<T, Unorm16> || std::is_same_v<T, PackedRange> || std::is_same_v<T, PackedNormal>)
        return 2;
    else if constexpr (std::is_same_v<T, glm::dvec3>) return 8;
    else if constexpr (std::is_same_v<T, Texel> || std::is_same_v<T, std::byte>) return 1;
    else return 4; // vectors, spheres and triangles of 4-byte components; of NodeBounds, the sphere
}

// Ranges as text-like records: kind, length of the name, first triangle, count, name.
std::vector<std::byte> pack_ranges(std::span<const MeshRange> ranges) {
    std::vector<std::byte> out;
    const auto put = [&](std::uint64_t value) {
        for (int i = 0; i < 8; ++i) out.push_back(static_cast<std::byte>(value >> (8 * i)));
    };
    for (const MeshRange& r : ranges) {
        put(static_cast<std::uint64_t>(r.kind));
        put(r.name.size());
        put(r.first_triangle);
        put(r.triangle_count);
        for (const char c : r.name) out.push_back(static_cast<std::byte>(c));
    }
    return out;
}

bool unpack_ranges(std::span<const std::byte> bytes, std::vector<MeshRange>& ranges) {
    std::size_t at = 0;
    const auto get = [&](std::uint64_t& value) {
        if (bytes.size() - at < 8) return false;
        value = 0;
        for (std::size_t i = 0; i < 8; ++i) value |= std::to_integer<std::uint64_t>(bytes[at + i]) << (8 * i);
        at += 8;
        return true;
    };
    while (at < bytes.size()) {
        std::uint64_t kind, length, first, count;
        if (!get(kind) || !get(length) || !get(first) || !get(count)) return false;
        if (kind > static_cast<std::uint64_t>(MeshRange::Kind::primitive) || length > bytes.size() - at) return false;
        MeshRange r;
        r.kind = static_cast<MeshRange::Kind>(kind);
        r.name.assign(reinterpret_cast<const char*>(bytes.data()) + at, length);
        r.first_triangle = first;
        r.triangle_count = count;
        ranges.push_back(std::move(r));
        at += length;
    }
    return true;
}

Facts facts_of(const TreeGeometry& g, const TreeLuminance& l) {
    const Sphere& s = g.bounding_sphere;
    return {{g.origin.x, g.origin.y, g.origin.z},
            {s.centre.x, s.centre.y, s.centre.z, s.radius},
            {l.light.direction.x, l.light.direction.y, l.light.direction.z, l.light.ambient},
            {l.range.lo, l.range.hi},
            g.dropped_triangles,
            static_cast<std::uint32_t>(g.closedness),
            l.prelit ? 1u : 0u,
            l.light.fill,
            g.source_vertex_count,
            static_cast<std::uint32_t>(g.creases.source),
            g.creases.degrees};
}

// ---- writing

class Writer {
public:
    template <class T>
    void add(std::string_view name, std::span<const T> values, std::uint32_t component) {
        add({std::string(name), AttributeDomain{part_of_tree}, sizeof(T), component, values.size(), nullptr,
             std::as_bytes(values)});
    }
    void add(const Attribute& a) {
        Section& s = sections_.emplace_back();
        std::copy_n(a.name.begin(), std::min(a.name.size(), s.name.size()), s.name.begin());
        s.domain = static_cast<std::uint32_t>(a.domain);
        s.element_bytes = a.element_bytes;
        s.component_bytes = a.component_bytes;
        s.count = a.bytes.size() / a.element_bytes;
        data_.push_back(a.bytes);
    }

    Result<void> write(const std::filesystem::path& file, const Progress& progress) {
        layout();
        Result<AtomicFile> out = AtomicFile::create(file);
        if (!out) return out.error();
        if (const auto r = write_table(*out); !r) return r;
        std::uint64_t position = table_bytes();
        for (std::size_t i = 0; i < sections_.size(); ++i) {
            if (progress && !progress(static_cast<double>(i) / static_cast<double>(sections_.size()), "writing"))
                return Error{ErrorCode::cancelled, "Writing " + file.string() + " was cancelled."};
            const std::vector<std::byte> padding(sections_[i].offset - position);
            if (const auto r = out->write(padding); !r) return r;
            if (const auto r = out->write(data_[i]); !r) return r;
            position = sections_[i].offset + data_[i].size();
        }
        return out->commit();
    }

private:
    std::uint64_t table_bytes() const {
        return sizeof(Header) + sections_.size() * sizeof(Section) + checksums_.size() * sizeof(std::uint64_t);
    }

    void layout() {
        for (const std::span<const std::byte> bytes : data_)
            for (std::size_t at = 0; at < bytes.size(); at += page_bytes)
                checksums_.push_back(checksum(&bytes[at], std::min<std::size_t>(page_bytes, bytes.size() - at)));
        std::uint64_t offset = table_bytes();
        for (std::size_t i = 0; i < sections_.size(); ++i) {
            offset = (offset + section_alignment - 1) / section_alignment * section_alignment;
            sections_[i].offset = offset;
            offset += data_[i].size();
        }
        file_bytes_ = offset;
    }

    Result<void> write_table(AtomicFile& out) {
        const auto sections = std::as_bytes(std::span(sections_)), sums = std::as_bytes(std::span(checksums_));
        std::vector<std::byte> table(sections.begin(), sections.end());
        table.insert(table.end(), sums.begin(), sums.end());
        Header h{magic,
                 format_version,
                 static_cast<std::uint32_t>(sections_.size()),
                 file_bytes_,
                 checksums_.size(),
                 checksum(table.data(), table.size()),
                 0};
        h.header_checksum = checksum(&h, offsetof(Header, header_checksum));
        if (const auto r = out.write(std::as_bytes(std::span(&h, 1))); !r) return r;
        return out.write(table);
    }

    std::vector<Section> sections_;
    std::vector<std::span<const std::byte>> data_;
    std::vector<std::uint64_t> checksums_;
    std::uint64_t file_bytes_ = 0;
};

// ---- reading

class Reader {
public:
    // `maps`: the arrays stay in the file until they are used.
    Reader(const std::filesystem::path& file, bool maps, const Progress& progress)
        : file_(file), maps_(maps), progress_(progress) {}

    Result<VertexTree> read() {
        if (const auto r = read_table(); !r) return r.error();
        if (maps_) {
            auto mapping = MappedFile::open(file_);
            if (!mapping) return mapping.error();
            mapping_ = std::move(*mapping);
        }
        auto geometry = std::make_shared<TreeGeometry>();
        auto data = std::make_shared<VertexTree::Data>();
        TreeGeometry& g = *geometry;
        const auto light = std::make_shared<TreeLuminance>();
        TreeLuminance& l = *light;
        g.mapping = mapping_;
        Result<void> state;
        std::size_t done = 0;
        for_each_array(g, l, [&](std::string_view name, auto& values) {
            if (!state) return;
            if (progress_ && !progress_(static_cast<double>(done++) / static_cast<double>(sections_.size()), "reading"))
                state = Error{ErrorCode::cancelled, "Reading " + file_.string() + " was cancelled."};
            else state = open_section(name, values);
        });
        if (!state) return state.error();
        if (const auto r = read_facts(g, l); !r) return r.error();
        if (const auto r = check_counts(g, l); !r) return r.error();
        if (const auto r = check_ranges(g); !r) return r.error();
        if (const auto r = read_attributes(g.first_leaf.size(), g.parents.size(), data->attributes); !r)
            return r.error();
        l.textured = !g.texture.empty();
        if (maps_) {
            data->checks = std::make_shared<NodeChecks>(g, l);
            if (const char* fault = fault_in_root(g)) return fail(std::string("Node 0 ") + fault);
            if (!data->checks->is_sound(0)) return fail("Node 0 is damaged.");
        } else {
            if (const auto r = check_structure(g); !r) return r.error();
            if (const std::string fault = fault_in_sections(g, l); !fault.empty()) return fail(fault);
        }
        data->geometry = std::move(geometry);
        data->light = light;
        return VertexTree(std::move(data));
    }

private:
    Error fail(const std::string& what) const {
        return {ErrorCode::malformed_data, file_.string() + ": " + what + " Build the tree again from its mesh."};
    }

    Result<void> read_table() {
        std::error_code error;
        // Not opened before: a pipe would wait for its writer.
        if (std::filesystem::is_regular_file(file_, error)) in_.open(file_, std::ios::binary);
        if (!in_.is_open()) return Error{ErrorCode::io_failure, "Cannot open " + file_.string() + "; does it exist?"};
        file_bytes_ = std::filesystem::file_size(file_, error);
        if (error) return Error{ErrorCode::io_failure, "Cannot tell the size of " + file_.string() + "."};
        Header h;
        if (!in_.read(reinterpret_cast<char*>(&h), sizeof h)) return fail("The file ends within its header.");
        if (h.magic != magic) return fail("This is no vertex tree (.vdt).");
        const std::uint64_t sum = checksum(&h, offsetof(Header, header_checksum));
        if (h.version != format_version)
            return Error{ErrorCode::unsupported,
                         file_.string() +
                             (h.version < format_version
                                  ? " was written by an earlier version; build it again with: unseen build MESH -o FILE"
                                  : ": version " + std::to_string(h.version) +
                                        " of the format is not known to this program, which reads version " +
                                        std::to_string(format_version) + ". Build the tree again from its mesh.")};
        if (h.header_checksum != sum) return fail("The header is damaged.");
        if (h.file_bytes != file_bytes_)
            return fail("The file has " + std::to_string(file_bytes_) + " bytes instead of " +
                        std::to_string(h.file_bytes) + "; it was cut short or changed.");
        if (h.section_count > most_sections || h.page_count > file_bytes_ / sizeof(std::uint64_t))
            return fail("The section table is larger than the file.");
        std::vector<std::byte> bytes(h.section_count * sizeof(Section) + h.page_count * 8);
        if (!in_.read(reinterpret_cast<char*>(bytes.data()), static_cast<std::streamsize>(bytes.size())))
            return fail("The file ends within its section table.");
        if (checksum(bytes.data(), bytes.size()) != h.table_checksum) return fail("The section table is damaged.");
        sections_.resize(h.section_count);
        checksums_.resize(h.page_count);
        if (h.section_count > 0) std::memcpy(sections_.data(), bytes.data(), h.section_count * sizeof(Section));
        if (h.page_count > 0)
            std::memcpy(checksums_.data(), bytes.data() + h.section_count * sizeof(Section), h.page_count * 8);
        std::uint64_t pages = 0;
        for (const Section& s : sections_) {
            const std::string name(name_of(s));
            if (s.element_bytes == 0 || s.offset > file_bytes_ || s.count > (file_bytes_ - s.offset) / s.element_bytes)
                return fail("Section " + name + " does not fit in the file.");
            pages += pages_of(s);
        }
        if (pages != checksums_.size()) return fail("The number of pages does not match the sections.");
        return {};
    }

    const Section* find(std::string_view name) const {
        for (const Section& s : sections_)
            if (s.domain == part_of_tree && name_of(s) == name) return &s;
        return nullptr;
    }

    template <class T>
    Result<const Section*> section_of(std::string_view name) const {
        const Section* section = find(name);
        if (!section) return fail("Section " + std::string(name) + " is missing.");
        if (section->element_bytes != sizeof(T))
            return fail("Section " + std::string(name) + " has elements of another size.");
        return section;
    }

    template <class T>
    Result<void> read_section(std::string_view name, std::vector<T>& out) {
        const auto section = section_of<T>(name);
        if (!section) return section.error();
        out.resize((*section)->count);
        return read_pages(**section, reinterpret_cast<std::byte*>(out.data()));
    }

    Result<void> read_pages(const Section& section, std::byte* bytes) {
        const std::string name(name_of(section));
        in_.clear();
        in_.seekg(static_cast<std::streamoff>(section.offset));
        std::uint64_t page = 0;
        for (const Section* before = sections_.data(); before != &section; ++before) page += pages_of(*before);
        const std::uint64_t total = section.count * section.element_bytes;
        for (std::uint64_t at = 0; at < total; at += page_bytes, ++page) {
            const std::uint64_t size = std::min(page_bytes, total - at);
            if (!in_.read(reinterpret_cast<char*>(bytes + at), static_cast<std::streamsize>(size)))
                return fail("The file ends within section " + name + "; it was cut short while it was read.");
            if (checksum(bytes + at, size) != checksums_[page])
                return fail("Page " + std::to_string(at / page_bytes) + " of section " + name + " is damaged.");
        }
        return {};
    }

    Result<std::span<const std::byte>> mapped_bytes(const Section& section) const {
        const std::string name(name_of(section));
        if (section.offset % section_alignment != 0)
            return fail("Section " + name + " does not begin at a multiple of 64.");
        // The mapping was made after the table was read: the file may have been replaced in between.
        const auto bytes = mapping_->bytes();
        const std::uint64_t size = section.count * section.element_bytes;
        if (section.offset > bytes.size() || size > bytes.size() - section.offset)
            return fail("Section " + name + " does not fit in the file.");
        return bytes.subspan(section.offset, size);
    }

    // Attributes of names that nobody here knows, too. Their values are their owners' to check.
    Result<void> read_attributes(std::size_t interior_count, std::size_t node_count,
                                 std::vector<Attribute>& attributes) {
        for (const Section& s : sections_) {
            if (s.domain == part_of_tree) continue;
            Attribute a{std::string(name_of(s)), AttributeDomain{s.domain}, s.element_bytes, s.component_bytes,
                        s.count};
            if (const std::string fault = fault_in_attribute(a, interior_count, node_count); !fault.empty())
                return fail(fault);
            for (const Attribute& before : attributes)
                if (before.name == a.name) return fail("Attribute " + a.name + " is there twice.");
            if (attributes.size() == most_attributes) return fail("There are more attributes than a tree can have.");
            if (maps_) {
                const auto bytes = mapped_bytes(s);
                if (!bytes) return bytes.error();
                a.owner = mapping_;
                a.bytes = *bytes;
            } else {
                const auto bytes = std::make_shared<std::vector<std::byte>>(s.count * s.element_bytes);
                if (const auto r = read_pages(s, bytes->data()); !r) return r;
                a.bytes = *bytes;
                a.owner = bytes;
            }
            attributes.push_back(std::move(a));
        }
        return {};
    }

    template <class T>
    Result<void> open_section(std::string_view name, Array<T>& out) {
        if (is_optional(name) && !find(name)) return {};
        if (!maps_) {
            std::vector<T> values;
            const auto r = read_section(name, values);
            out = std::move(values);
            return r;
        }
        const auto section = section_of<T>(name);
        if (!section) return section.error();
        const auto bytes = mapped_bytes(**section);
        if (!bytes) return bytes.error();
        out = Array<T>(std::span(reinterpret_cast<const T*>(bytes->data()), (*section)->count));
        return {};
    }

    Result<void> read_facts(TreeGeometry& g, TreeLuminance& l) {
        std::vector<Facts> facts;
        std::vector<std::byte> ranges;
        if (const auto r = read_section("facts", facts); !r) return r.error();
        if (const auto r = read_section("ranges", ranges); !r) return r.error();
        if (facts.size() != 1) return fail("Section facts has the wrong length.");
        const Facts& f = facts[0];
        if (!unpack_ranges(ranges, g.ranges)) return fail("Section ranges is malformed.");
        if (f.closedness > static_cast<std::uint32_t>(Closedness::closed_inward) ||
            f.crease_source > static_cast<std::uint32_t>(Creases::Source::rule))
            return fail("Section facts is malformed.");
        g.origin = {f.origin[0], f.origin[1], f.origin[2]};
        g.bounding_sphere = {{f.bounding_sphere[0], f.bounding_sphere[1], f.bounding_sphere[2]}, f.bounding_sphere[3]};
        g.dropped_triangles = f.dropped_triangles;
        g.source_vertex_count = f.source_vertices;
        g.closedness = static_cast<Closedness>(f.closedness);
        g.creases = {static_cast<Creases::Source>(f.crease_source), f.crease_degrees};
        l.light = {{f.light[0], f.light[1], f.light[2]}, f.light[3], f.fill};
        l.prelit = f.prelit != 0;
        l.range = {f.luminance_range[0], f.luminance_range[1]};
        const double sum = g.origin.x + g.origin.y + g.origin.z;
        const auto is_finite = [](glm::vec3 v, float w) { return std::isfinite(v.x + v.y + v.z + w); };
        const bool facts_finite = std::isfinite(sum) && is_finite(g.bounding_sphere.centre, g.bounding_sphere.radius) &&
                                  is_finite(l.light.direction, l.light.ambient + l.light.fill) && l.range.lo >= 0 &&
                                  l.range.lo <= l.range.hi && l.range.hi <= 1 && g.bounding_sphere.radius >= 0 &&
                                  g.creases.degrees >= 0 && g.creases.degrees <= 180;
        if (!facts_finite) return fail("Section facts has a value out of range.");
        return {};
    }

    Result<void> check_counts(const TreeGeometry& g, const TreeLuminance& l) const {
        const std::size_t nodes = g.parents.size(), interior = g.first_leaf.size(), triangles = g.triangles.size();
        if (interior == 0 || nodes <= interior || nodes >= no_node || triangles == 0 || triangles >= no_node)
            return fail("The tree has no nodes or no triangles.");
        if (const char* section = section_against_wedges(g))
            return fail("Section " + std::string(section) + " does not fit the wedges of the other sections.");
        if (const char* section = section_against_needs(g))
            return fail("Section " + std::string(section) + " does not fit the other sections about what nodes need.");
        const std::size_t wedges = g.positions.size(), leaves = links_of(g).leaves();
        const std::pair<bool, const char*> checks[] = {
            {g.normals.size() == wedges, "normals"},
            {g.colours.empty() || g.colours.size() == wedges, "colours"},
            {g.uvs.empty() || g.uvs.size() == wedges, "uvs"},
            {l.luminance.size() == wedges, "luminance"},
            {g.leaf_end.size() == interior, "leaf_end"},
            {g.subtree_end.size() == interior, "subtree_end"},
            {g.first_triangle.size() == interior + 1, "first_triangle"},
            {g.support_spheres.size() == interior, "support_spheres"},
            {g.bounds.size() == interior, "bounds"},
            {g.mask_at.size() == interior, "mask_at"},
            {g.mask_records.size() > most_mask_bytes, "mask_records"},
            {g.displacement.size() == interior, "displacement"},
            {l.support_range.size() == interior, "support_range"},
            {l.ring_range.size() == interior, "ring_range"},
            {l.adaptation.size() == interior, "adaptation"},
            {g.source_triangles.size() == (g.ranges.empty() ? 0 : triangles), "source_triangles"},
            {g.source_vertices.size() == leaves, "source_vertices"},
            {g.texture.size() <= 1 && (g.texture.empty() || !g.uvs.empty()), "texture"},
            {g.texels.empty() == g.texture.empty(), "texels"},
            {g.blends.size() <= (g.texels.empty() ? 0 : 1), "blends"},
            {g.ring_texture.size() == (g.texture.empty() ? 0 : interior), "ring_texture"}};
        for (const auto& [holds, name] : checks)
            if (!holds) return fail("Section " + std::string(name) + " has the wrong length.");
        if (const std::string fault = fault_in_fold_weights(g); !fault.empty()) return fail(fault);
        if (const auto valid = validate(g.texture_view()); !valid) return fail(valid.error().message);
        return {};
    }

    // That walking the tree stays within it: every interior node's children lie side by side and cover it.
    Result<void> check_structure(const TreeGeometry& g) const {
        const NodeId interior = static_cast<NodeId>(g.first_leaf.size());
        const auto broken = [&](NodeId node, const char* fault) {
            return fail("Node " + std::to_string(node) + " " + fault);
        };
        if (const char* fault = fault_in_root(g)) return broken(0, fault);
        for (NodeId node = 0; node < interior; ++node)
            if (const char* fault = fault_in_links(g, node)) return broken(node, fault);
        return {};
    }

    // That the ranges lie in the mesh that the tree was built from.
    Result<void> check_ranges(const TreeGeometry& g) const {
        if (g.dropped_triangles > no_node) return fail("Section facts has a value out of range.");
        const std::uint64_t triangles = g.triangles.size() + g.dropped_triangles;
        for (const MeshRange& r : g.ranges)
            if (r.first_triangle > triangles || r.triangle_count > triangles - r.first_triangle)
                return fail("Range '" + r.name + "' ends after the last triangle.");
        return {};
    }

    const std::filesystem::path& file_;
    const bool maps_;
    const Progress& progress_;
    std::shared_ptr<const MappedFile> mapping_;
    std::ifstream in_;
    std::uint64_t file_bytes_ = 0;
    std::vector<Section> sections_;
    std::vector<std::uint64_t> checksums_;
};

} // namespace

Result<void> prepare_tree_file(const std::filesystem::path& file) {
    const Result<AtomicFile> out = AtomicFile::create(file);
    if (!out) return out.error();
    AtomicFile::remove_orphans(file);
    return {};
}

Result<void> write_tree(const std::filesystem::path& file, const VertexTree& tree, const Progress& progress) {
    const TreeGeometry& g = *tree.data().geometry;
    const TreeLuminance& l = *tree.data().light;
    Writer writer;
    for_each_array(g, l, [&](std::string_view name, const auto& values) {
        using T = typename std::remove_cvref_t<decltype(values)>::value_type;
        if (is_optional(name) && values.empty()) return;
        if (is_of_texture(name) && !l.textured) return;
        writer.add(name, std::span<const T>(values), component_bytes<T>());
    });
    const Facts facts = facts_of(g, l);
    const std::vector<std::byte> ranges = pack_ranges(g.ranges);
    writer.add("facts", std::span<const Facts>(&facts, 1), 1);
    writer.add("ranges", std::span<const std::byte>(ranges), 1);
    for (const Attribute& a : tree.data().attributes) writer.add(a);
    return writer.write(file, progress);
}

Result<VertexTree> read_tree(const std::filesystem::path& file, const Progress& progress) {
    return Reader(file, false, progress).read();
}

Result<VertexTree> map_tree(const std::filesystem::path& file) { return Reader(file, true, {}).read(); }

bool is_tree_file(const std::filesystem::path& file) {
    std::error_code error;
    if (!std::filesystem::is_regular_file(file, error)) return false; // a pipe would wait for its writer
    std::ifstream in(file, std::ios::binary);
    std::array<char, 8> start{};
    return in.read(start.data(), start.size()) && start == magic;
}

} // namespace unseen::vdtree
