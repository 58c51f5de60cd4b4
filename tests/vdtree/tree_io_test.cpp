// Tree files: what is written is read again; what is damaged, cut short or lying is refused.
#include <unseen/vdtree/tree_io.h>

#include <csignal>

#include <sys/resource.h>
#include <sys/stat.h>
#include <unistd.h>

#include <unseen/vdtree/builder.h>
#include <unseen/vdtree/cut.h>

#include "built.h"
#include "shapes.h"
#include "sound.h"
#include "temp_folder.h"
#include "testing.h"
#include "textures.h"
#include "tree_checks.h"
#include "tree_file.h"
#include "tree_use.h"

namespace unseen::vdtree::tree_io_test {

using support::built;

using support::TempFolder;
using support::TreeFile;

class TreeIo : public testing::Test {
protected:
    std::string bytes_of(const VertexTree& tree) {
        const auto written = write_tree(file_, tree);
        EXPECT_TRUE(written) << written.error().message;
        return support::read_bytes(file_);
    }
    Result<VertexTree> read_bytes(std::string_view bytes) {
        support::write_bytes(file_, bytes);
        return read_tree(file_);
    }
    // All the sections that there are, and two that others keep.
    std::string bytes_with_everything() {
        Mesh mesh = shapes::with_attributes(shapes::cube(2));
        mesh.texture = textures::noise(4, 3, 1);
        return bytes_of(marked(built(mesh)));
    }
    static VertexTree marked(const VertexTree& tree) {
        std::vector<float> of_nodes(tree.interior_count());
        std::iota(of_nodes.begin(), of_nodes.end(), 0.5f);
        const auto once = tree.with_attribute("mark", AttributeDomain::interior_node, std::move(of_nodes));
        EXPECT_TRUE(once) << once.error().message;
        auto twice = once->with_attribute("note", AttributeDomain::tree, std::vector<std::uint16_t>{1, 2, 3});
        EXPECT_TRUE(twice) << twice.error().message;
        return std::move(*twice);
    }
    void expect_refused(std::string_view bytes, const std::string& reason) {
        const auto tree = read_bytes(bytes);
        ASSERT_FALSE(tree) << "expected: " << reason;
        EXPECT_THAT(tree.error().message, HasSubstr(reason));
        EXPECT_THAT(tree.error().message, HasSubstr(file_.filename().string()));
    }

    TempFolder folder_;
    std::filesystem::path file_ = folder_ / "tree.vdt";
};

TEST_F(TreeIo, ReadsWhatWasWritten) {
    for (const shapes::Named& named : shapes::all()) {
        SCOPED_TRACE(named.name);
        const VertexTree tree = built(named.mesh);
        ASSERT_TRUE(write_tree(file_, tree));
        const auto again = require(read_tree(file_));
        EXPECT_EQ(support::difference(tree, *again), "");
        const auto mapped = require(map_tree(file_));
        EXPECT_EQ(support::difference(tree, *mapped), "");
        EXPECT_TRUE(mapped->check());
        EXPECT_EQ(mapped->byte_size(), again->byte_size());
        EXPECT_TRUE(is_tree_file(file_));
    }
    EXPECT_EQ(folder_.file_count(), 1u); // no temporary files are left
}

TEST_F(TreeIo, KeepsAnotherLight) {
    const VertexTree tree =
        *built(shapes::bumpy_sphere(2)).relit({.direction = {1, 0, 0}, .ambient = 0.5f, .fill = 0.75f});
    ASSERT_TRUE(write_tree(file_, tree));
    EXPECT_EQ(support::difference(tree, *require(read_tree(file_))), "");
}

TEST_F(TreeIo, TakesSectionsOfSeveralPages) {
    const VertexTree tree = built(shapes::bumpy_sphere(6)); // 41k vertices: bounds alone are more than 1 MB
    std::string bytes = bytes_of(tree);
    EXPECT_EQ(support::difference(tree, *require(read_tree(file_))), "");
    // Damage to the second page of the bounds is found there.
    const auto parsed = TreeFile::parse(bytes);
    for (std::size_t i = 0; i < parsed.sections.size(); ++i) {
        if (parsed.sections[i].name != "bounds") continue;
        ASSERT_GT(parsed.sections[i].data.size(), TreeFile::page_bytes + 5);
        const auto offset = support::load<std::uint64_t>(bytes, TreeFile::header_bytes + i * TreeFile::entry_bytes +
                                                                    TreeFile::offset_at);
        bytes[offset + TreeFile::page_bytes + 5] ^= 1;
    }
    expect_refused(bytes, "Page 1 of section bounds is damaged");
}

TEST_F(TreeIo, WritesTheDocumentedFormat) {
    // Written a second time by this test's own code, from the description of the format.
    for (const Mesh& mesh : {shapes::cube(2), shapes::with_attributes(shapes::torus(8, 5))}) {
        const std::string bytes = bytes_of(built(mesh));
        EXPECT_EQ(TreeFile::parse(bytes).bytes(), bytes);
    }
}

TEST_F(TreeIo, WritesTheSameBytesEveryTime) {
    const VertexTree tree = built(shapes::with_attributes(shapes::cube(2)));
    EXPECT_EQ(bytes_of(tree), bytes_of(tree));
}

TEST_F(TreeIo, IgnoresSectionsThatItDoesNotKnow) {
    const VertexTree tree = built(shapes::cube(2));
    TreeFile file = TreeFile::parse(bytes_of(tree));
    file.sections.insert(file.sections.begin() + 3, {"from_the_future", 3, 1, "abcdef"});
    EXPECT_EQ(support::difference(tree, *require(read_bytes(file.bytes()))), "");
}

TEST_F(TreeIo, RefusesEveryTruncation) {
    const std::string bytes = bytes_of(built(shapes::single_triangle()));
    for (std::size_t length = 0; length < bytes.size(); ++length) {
        const auto tree = read_bytes(std::string_view(bytes).substr(0, length));
        ASSERT_FALSE(tree) << "cut at byte " << length;
        ASSERT_FALSE(tree.error().message.empty());
        ASSERT_FALSE(map_tree(file_)) << "cut at byte " << length;
    }
    expect_refused(bytes + '\0', "instead of");
}

TEST_F(TreeIo, FindsEveryFlippedBit) {
    const VertexTree tree = built(shapes::with_attributes(shapes::cube(1)));
    const std::string bytes = bytes_of(tree);
    const std::size_t table_bits =
        8 * (TreeFile::header_bytes + TreeFile::parse(bytes).sections.size() * TreeFile::entry_bytes);
    std::mt19937_64 random(1);
    int refused = 0;
    for (std::size_t round = 0; round < 5000; ++round) {
        const std::size_t bit = round % 2 ? random() % table_bits : random() % (bytes.size() * 8);
        std::string damaged = bytes;
        damaged[bit / 8] = static_cast<char>(damaged[bit / 8] ^ (1 << (bit % 8)));
        const auto again = read_bytes(damaged);
        // Only a bit between two sections may go unnoticed.
        ASSERT_EQ(again ? support::difference(tree, *again) : "", "") << "bit " << bit;
        refused += !again;
    }
    EXPECT_GT(refused, 4500);
}

TEST_F(TreeIo, SaysWhatIsWrongWithTheHeader) {
    const std::string good = bytes_of(built(shapes::cube(1)));
    expect_refused("", "ends within its header");
    expect_refused("solid cube", "ends within its header");
    expect_refused(std::string(200, 'x'), "no vertex tree");
    EXPECT_FALSE(is_tree_file(file_));

    std::string bad = good;
    for (const std::uint32_t version : {8u, ~0u}) {
        support::store(bad, TreeFile::version_at, version);
        TreeFile::seal(bad);
        expect_refused(bad, "version " + std::to_string(version) + " of the format");
        expect_refused(bad, "Build the tree again from its mesh");
        EXPECT_EQ(read_bytes(bad).error().code, ErrorCode::unsupported);
    }
    for (const std::uint32_t version : {0u, 2u, 4u, 6u}) {
        support::store(bad, TreeFile::version_at, version);
        TreeFile::seal(bad);
        expect_refused(bad,
                       "tree.vdt was written by an earlier version; build it again with: unseen build MESH -o FILE");
        EXPECT_EQ(read_bytes(bad).error().code, ErrorCode::unsupported);
    }

    bad = good;
    bad[TreeFile::file_bytes_at] ^= 1;
    expect_refused(bad, "header is damaged");
    TreeFile::seal(bad);
    expect_refused(bad, "instead of");
}

TEST_F(TreeIo, RefusesTablesThatDoNotFit) {
    const std::string good = bytes_of(built(shapes::cube(1)));
    const std::uint64_t large[] = {good.size(), 1ull << 32, 1ull << 61, 1ull << 63, ~0ull, ~0ull - 7};
    for (const std::uint64_t value : large) {
        for (const std::size_t at : {TreeFile::page_count_at, TreeFile::file_bytes_at}) {
            if (at == TreeFile::file_bytes_at && value == good.size()) continue;
            std::string bad = good;
            support::store(bad, at, value);
            TreeFile::seal(bad);
            ASSERT_FALSE(read_bytes(bad)) << at << ": " << value;
        }
        for (std::size_t section = 0; section < TreeFile::parse(good).sections.size(); ++section) {
            for (const std::size_t at : {TreeFile::count_at, TreeFile::offset_at}) {
                std::string bad = good;
                support::store(bad, TreeFile::header_bytes + section * TreeFile::entry_bytes + at, value);
                TreeFile::seal(bad);
                const auto tree = read_bytes(bad);
                // A section without elements may stand at the file's end.
                ASSERT_TRUE(!tree || (at == TreeFile::offset_at && value == good.size())) << section << ": " << value;
            }
        }
    }
    const auto sections = static_cast<std::uint32_t>(TreeFile::parse(good).sections.size());
    for (const std::uint32_t count : {0u, 1u, sections - 1, sections + 1, 65u, 1u << 31, ~0u}) {
        std::string bad = good;
        support::store(bad, TreeFile::section_count_at, count);
        TreeFile::seal(bad);
        ASSERT_FALSE(read_bytes(bad)) << count;
    }
    for (const std::uint32_t size : {0u, 3u, 1u << 31, ~0u}) {
        std::string bad = good;
        support::store(bad, TreeFile::header_bytes + TreeFile::element_bytes_at, size);
        TreeFile::seal(bad);
        ASSERT_FALSE(read_bytes(bad)) << size;
    }
}

// Names that nobody here knows come back from files that were read and from files that were mapped, and go into the
// next.
TEST_F(TreeIo, KeepsAttributesOfAnyName) {
    const VertexTree tree = marked(built(shapes::bumpy_sphere(2)));
    const auto expect_kept = [&](const VertexTree& kept) {
        ASSERT_EQ(kept.attributes().size(), 2u);
        EXPECT_TRUE(std::ranges::equal(kept.attribute<float>("mark"), tree.attribute<float>("mark")));
        EXPECT_THAT(kept.attribute<std::uint16_t>("note"), testing::ElementsAre(1, 2, 3));
    };
    expect_kept(tree);
    const std::string bytes = bytes_of(tree);
    const auto other = folder_ / "other.vdt";
    for (const auto& open : {read_tree(file_), map_tree(file_)}) {
        ASSERT_TRUE(open) << open.error().message;
        expect_kept(*open);
        EXPECT_TRUE(open->check());
        ASSERT_TRUE(write_tree(other, *open));
        EXPECT_EQ(support::read_bytes(other), bytes);
        const auto more =
            open->with_attribute("more", AttributeDomain::node, std::vector<double>(tree.node_count(), 7));
        ASSERT_TRUE(more) << more.error().message;
        ASSERT_TRUE(write_tree(other, *more));
        const auto again = require(read_tree(other));
        EXPECT_EQ(again->attributes().size(), 3u);
        EXPECT_EQ(again->attribute<double>("more").size(), tree.node_count());
        EXPECT_EQ(support::difference(*again, tree), "");
    }
}

TEST_F(TreeIo, GivesAttributesOfOneTypeOnly) {
    const VertexTree plain = built(shapes::cube(2)), tree = marked(plain);
    EXPECT_TRUE(plain.attributes().empty());
    EXPECT_TRUE(plain.attribute<float>("mark").empty());
    EXPECT_FALSE(tree.attribute<float>("mark").empty());
    EXPECT_TRUE(tree.attribute<double>("mark").empty()) << "of another size";
    EXPECT_TRUE(tree.attribute<float>("marks").empty());
    EXPECT_EQ(tree.positions().data(), plain.positions().data()) << "all else is shared";
    const auto replaced = require(tree.with_attribute("mark", AttributeDomain::tree, std::vector<float>{1}));
    EXPECT_EQ(replaced->attribute<float>("mark").size(), 1u);
    EXPECT_EQ(replaced->attributes().size(), 2u);
    for (const char* name : {"", "with space", "a name longer than it may be"})
        EXPECT_FALSE(tree.with_attribute(name, AttributeDomain::tree, std::vector<float>{1})) << name;
    EXPECT_FALSE(tree.with_attribute("mark", AttributeDomain::node, std::vector<float>{1}));
    EXPECT_TRUE(tree.relit({.direction = {0, 0, 1}})->attributes().empty());
    VertexTree full = tree.share();
    for (std::size_t i = 2; i < most_attributes; ++i)
        full = *full.with_attribute("a" + std::to_string(i), AttributeDomain::tree, std::vector<float>{1});
    EXPECT_FALSE(full.with_attribute("more", AttributeDomain::tree, std::vector<float>{1}));
    EXPECT_TRUE(full.with_attribute("mark", AttributeDomain::tree, std::vector<float>{1}));
    ASSERT_TRUE(write_tree(file_, full));
    EXPECT_TRUE(read_tree(file_));
}

struct Lie {
    const char* what;
    std::function<void(TreeFile&)> tell;
};

std::vector<Lie> lies() {
    constexpr float nan = std::numeric_limits<float>::quiet_NaN(), inf = std::numeric_limits<float>::infinity();
    const auto set = [](const char* section, std::size_t i, auto value) {
        return [=](TreeFile& file) { file[section].set(i, value); };
    };
    const auto drop_last = [](const char* section) {
        return [=](TreeFile& file) {
            auto& s = file[section];
            s.data.resize(s.data.size() - s.element_bytes);
        };
    };
    std::vector<Lie> all = {
        {"the root has a parent", set("parents", 0, 1u)},
        {"a node is its own parent", set("parents", 1, 1u)},
        {"a parent comes later", set("parents", 1, 2u)},
        {"a parent is out of range", set("parents", 2, 0x7fffffffu)},
        {"a leaf has no parent", [](TreeFile& f) { f["parents"].set(f["first_leaf"].count() + 1, 0xffffffffu); }},
        {"a leaf's parent is a leaf",
         [](TreeFile& f) {
             f["parents"].set(f["first_leaf"].count() + 1, static_cast<std::uint32_t>(f["first_leaf"].count()));
         }},
        {"the root lacks a leaf", set("first_leaf", 0, 1u)},
        {"a node begins beyond the leaves", set("first_leaf", 1, 0xfffffffeu)},
        {"a node ends beyond the leaves", set("leaf_end", 1, 0xfffffffeu)},
        {"a node ends before it begins", set("leaf_end", 1, 0u)},
        {"leaves overlap", [](TreeFile& f) { f["leaf_end"].set(1, f["leaf_end"].get<std::uint32_t>(1) + 1); }},
        {"a node lacks a leaf", [](TreeFile& f) { f["leaf_end"].set(1, f["leaf_end"].get<std::uint32_t>(1) - 1); }},
        {"a subtree is empty", set("subtree_end", 1, 1u)},
        {"a subtree ends before it begins", set("subtree_end", 1, 0u)},
        {"a subtree is endless", set("subtree_end", 1, 0xffffffffu)},
        {"the tree ends early",
         [](TreeFile& f) { f["subtree_end"].set(0, f["subtree_end"].get<std::uint32_t>(0) - 1); }},
        {"triangles do not begin at 0", set("first_triangle", 0, 1u)},
        {"triangle ranges overlap", set("first_triangle", 1, 0x7fffffffu)},
        {"triangles are not covered",
         [](TreeFile& f) { f["first_triangle"].set(f["first_triangle"].count() - 1, 1u); }},
        {"a corner is no leaf", set("triangles", 4, 0xffffffu)},
        {"a corner is just beyond the leaves",
         [](TreeFile& f) { f["triangles"].set(0, static_cast<std::uint32_t>(f["source_vertices"].count())); }},
        {"a corner comes twice", [](TreeFile& f) { f["triangles"].set(1, f["triangles"].get<std::uint32_t>(0)); }},
        {"a triangle vanishes elsewhere",
         [](TreeFile& f) {
             for (std::size_t k = 0; k < 3; ++k) {
                 const auto corner = f["triangles"].get<std::uint32_t>(k);
                 const std::size_t last = f["triangles"].count() * 3 - 3 + k;
                 f["triangles"].set(k, f["triangles"].get<std::uint32_t>(last));
                 f["triangles"].set(last, corner);
             }
         }},
        {"a source vertex is out of range", set("source_vertices", 0, 0x7fffffffu)},
        {"a source triangle is out of range", set("source_triangles", 0, 0x7fffffffu)},
        {"an infinite position", set("positions", 3, inf)},
        {"a position that is no number", set("positions", 3, nan)},
        {"a colour that is no number", set("colours", 1, nan)},
        {"an infinite UV", set("uvs", 1, inf)},
        {"a sphere without a centre", set("support_spheres", 0, nan)},
        {"a sphere of negative radius", set("support_spheres", 3, -1.0f)},
        {"a ring sphere of negative radius", set("bounds", 3, -1.0f)},
        {"a ring sphere of infinite radius", set("bounds", 3, inf)},
        {"a displacement that is no number", set("displacement", 0, nan)},
        {"a negative displacement", set("displacement", 0, -1.0f)},
        {"a luminance range in reverse", set("support_range", 0, 0x00010002u)},
        {"a luminance range of a ring in reverse", set("ring_range", 0, 0x00010002u)},
        {"a mask behind the records", set("mask_at", 1, 0x7fffffffu)},
        {"a mask just behind the records",
         [](TreeFile& f) { f["mask_at"].set(1, static_cast<std::uint32_t>(f["mask_records"].count() - 55)); }},
        {"no mask records", [](TreeFile& f) { f["mask_records"].data.resize(55); }},
        {"the facts: an origin that is no number",
         [](TreeFile& f) { f["facts"].set(1, std::numeric_limits<double>::quiet_NaN()); }},
        {"the facts: a bounding sphere of negative radius", set("facts", 9, -1.0f)},
        {"the facts: a light that is no number", set("facts", 10, nan)},
        {"the facts: a luminance that is no number", set("facts", 14, nan)},
        {"the facts: luminances in reverse", [](TreeFile& f) { f["facts"].set(14, 0.9f), f["facts"].set(15, 0.1f); }},
        {"the facts: no closedness", set("facts", 18, 3u)},
        {"the facts: normals from nowhere", set("facts", 22, 3u)},
        {"the facts: a crease angle that is no number", set("facts", 23, nan)},
        {"the facts: a crease angle beyond 180 degrees", set("facts", 23, 181.0f)},
        {"the facts: twice", [](TreeFile& f) { f["facts"].data += f["facts"].data; }},
        {"the facts: none", [](TreeFile& f) { f["facts"].data.clear(); }},
        {"a range of an unknown kind", set("ranges", 0, std::uint64_t{9})},
        {"a range with an endless name", set("ranges", 1, ~std::uint64_t{0})},
        {"a range that begins beyond the triangles", set("ranges", 2, std::uint64_t{1} << 40)},
        {"a range that ends beyond the triangles", set("ranges", 3, std::uint64_t{1} << 40)},
        {"a range whose end wraps around",
         [](TreeFile& f) { f["ranges"].set(2, std::uint64_t{5}), f["ranges"].set(3, ~std::uint64_t{0} - 3); }},
        {"a range that is cut short", [](TreeFile& f) { f["ranges"].data.pop_back(); }},
        {"no triangle", [](TreeFile& f) { f["triangles"].data.clear(), f["source_triangles"].data.clear(); }},
        {"no interior node",
         [](TreeFile& f) {
             for (const char* name : {"first_leaf", "leaf_end", "subtree_end", "bounds", "support_spheres", "mask_at",
                                      "displacement", "support_range", "ring_range", "adaptation"})
                 f[name].data.clear();
             f["first_triangle"].data.resize(4);
         }},
        {"nothing at all", [](TreeFile& f) { f.sections.clear(); }},
        {"an attribute of other nodes", [](TreeFile& f) { f["mark"].data.resize(4); }},
        {"an attribute of nothing", [](TreeFile& f) { f["mark"].domain = 4; }},
        {"an attribute without a name", [](TreeFile& f) { f["mark"].name = ""; }},
        {"an attribute whose name is no text", [](TreeFile& f) { f["mark"].name = "a b"; }},
        {"an attribute that is there twice", [](TreeFile& f) { f["mark"].name = "note"; }},
        {"an attribute of no components", [](TreeFile& f) { f["mark"].component_bytes = 0; }},
        {"an attribute of odd components", [](TreeFile& f) { f["mark"].component_bytes = 3; }},
        {"too many attributes",
         [](TreeFile& f) {
             for (std::size_t i = 0; i < most_attributes; ++i) {
                 f.sections.push_back(f["note"]);
                 f.sections.back().name = "note" + std::to_string(i);
             }
         }},
        {"a texture of no width", set("texture", 0, 0u)},
        {"a texture of endless height", set("texture", 1, 0xffffffffu)},
        {"a texture of other texels", set("texture", 0, 5u)},
        {"a texture that repeats in an unknown way", set("texture", 2, 0xffffffffu)},
        {"two textures", [](TreeFile& f) { f["texture"].data += f["texture"].data; }},
        {"a texture without coordinates", [](TreeFile& f) { f["uvs"].data.clear(); }},
        {"a texture without texels", [](TreeFile& f) { f["texels"].data.clear(); }},
        {"texels without a texture", [](TreeFile& f) { f["texture"].data.clear(); }},
        {"a range of a texture in reverse", set("ring_texture", 0, 0x00010002u)},
    };
    for (const char* section : {"several", "extra_wedges", "further"})
        for (const std::size_t at : {0u, 1u}) all.push_back({section, set(section, at, 0x7fffffffu)});
    for (const char* section : {"leaf_ranks", "wedge_ranks"}) all.push_back({section, set(section, 0, 0xfffffff0u)});
    for (const char* section :
         {"parents",          "positions",       "normals",       "colours",        "uvs",          "luminance",
          "first_leaf",       "leaf_end",        "subtree_end",   "first_triangle", "bounds",       "support_spheres",
          "mask_at",          "displacement",    "support_range", "ring_range",     "adaptation",   "triangles",
          "source_triangles", "source_vertices", "mark",          "texels",         "ring_texture", "several",
          "extra_wedges",     "further",         "leaf_ranks",    "wedge_ranks"})
        all.push_back({section, drop_last(section)});
    return all;
}

TEST_F(TreeIo, RefusesLies) {
    const std::string honest = bytes_with_everything();
    for (const Lie& lie : lies()) {
        TreeFile file = TreeFile::parse(honest);
        lie.tell(file);
        const auto tree = read_bytes(file.bytes());
        EXPECT_FALSE(tree) << lie.what;
        if (!tree) {
            EXPECT_EQ(tree.error().code, ErrorCode::malformed_data) << lie.what;
            EXPECT_THAT(tree.error().message, HasSubstr("tree.vdt")) << lie.what;
        }
        // Mapped, it may be found when a cut comes there, or do no harm.
        const auto mapped = map_tree(file_);
        if (mapped) EXPECT_TRUE(support::use_everything(*mapped)) << lie.what;
    }
}

TEST_F(TreeIo, MissesNoSection) {
    const TreeFile honest = TreeFile::parse(bytes_of(built(shapes::cube(1))));
    for (std::size_t i = 0; i < honest.sections.size(); ++i) {
        TreeFile file = honest;
        const std::string name = file.sections[i].name;
        file.sections.erase(file.sections.begin() + static_cast<std::ptrdiff_t>(i));
        expect_refused(file.bytes(), name);
    }
}

// Random values in random places, all checksums right: an error, or a tree with which everything can be done.
TEST_F(TreeIo, SurvivesRandomLies) {
    const std::string honest = bytes_with_everything();
    std::mt19937_64 random(2);
    int accepted = 0, taken_mapped = 0, found_later = 0;
    for (int round = 0; round < 3000; ++round) {
        TreeFile file = TreeFile::parse(honest);
        for (std::uint64_t lie = 0; lie <= random() % 3; ++lie) {
            TreeFile::Section& s = file.sections[random() % file.sections.size()];
            const std::uint32_t interesting[] = {
                0,          1,          2,          7,          0x7f800000,
                0x7fc00000, 0x7f7fffff, 0x80000000, 0xffffffff, static_cast<std::uint32_t>(random())};
            if (s.data.size() >= 4)
                s.set(random() % (s.data.size() / 4), interesting[random() % std::size(interesting)]);
        }
        const auto tree = read_bytes(file.bytes());
        if (const auto mapped = map_tree(file_); mapped) {
            ASSERT_TRUE(support::use_everything(*mapped)) << "round " << round;
            ++taken_mapped;
            found_later += !mapped->check();
        }
        if (!tree) continue;
        ++accepted;
        ASSERT_TRUE(support::use_everything(*tree)) << "round " << round;
    }
    EXPECT_GT(taken_mapped, accepted);
    EXPECT_GT(found_later, 100); // by the checks of nodes
    EXPECT_GT(accepted, 100);    // normals, masks, slabs and small changes of values
}

// The node at which the triangles of a tree are the most.
NodeId node_with_triangles(const VertexTree& tree) {
    NodeId best = 1;
    for (NodeId node = 1; node < tree.interior_count(); ++node) {
        const auto count = [&](NodeId n) {
            return support::sound(tree).first_triangle()[n + 1] - support::sound(tree).first_triangle()[n];
        };
        if (count(node) > count(best)) best = node;
    }
    return best;
}

TEST_F(TreeIo, LeavesDamagedNodesOfAMappedTreeFolded) {
    const VertexTree tree = built(shapes::bumpy_sphere(3));
    const NodeId damaged = node_with_triangles(tree);
    const Index triangle = support::sound(tree).first_triangle()[damaged],
                below = support::sound(tree).first_triangle()[support::sound(tree).subtree_end()[damaged]];
    ASSERT_LT(triangle, support::sound(tree).first_triangle()[damaged + 1]);
    TreeFile file = TreeFile::parse(bytes_of(tree));
    file["triangles"].set(3 * triangle, 0x7fffffffu);
    support::write_bytes(file_, file.bytes());
    EXPECT_FALSE(read_tree(file_));

    const auto mapped = require(map_tree(file_));
    Cut cut(*mapped);
    cut.unfold_all();
    EXPECT_FALSE(cut.is_unfolded(damaged));
    EXPECT_TRUE(cut.is_active(damaged));
    EXPECT_EQ(cut.triangle_count(), tree.triangle_count() - (below - triangle));
    EXPECT_TRUE(validate(extract_mesh(cut).view()));
    EXPECT_FALSE(mapped->is_sound(damaged));

    // The rest is as it was; a criterion that asks for everything gets as much.
    Cut asked(*mapped);
    const auto all = [](const VertexTree&, std::span<const NodeId>, std::span<float> costs) {
        std::fill(costs.begin(), costs.end(), 2.0f);
    };
    EXPECT_EQ(asked.adjust(all).triangles, cut.triangle_count());
    asked.fold_all();
    EXPECT_EQ(asked.adjust(all, tree.triangle_count()).triangles, cut.triangle_count());
    EXPECT_EQ(asked.adjust(all, tree.triangle_count()).max_fold_cost, 2.0f);

    EXPECT_THAT(error_in(mapped->check()), HasSubstr("Node " + std::to_string(damaged)));
    EXPECT_FALSE(verify(*mapped));
    EXPECT_FALSE(mapped->relit({.direction = {1, 0, 0}}));
}

TEST_F(TreeIo, FollowsNoParentsIntoTheVoid) {
    const VertexTree tree = built(shapes::bumpy_sphere(2));
    const NodeId leaf = tree.node_count() - 1;
    for (const std::uint32_t parent : {0xffffffffu, 0x7fffffffu, 0u, leaf}) {
        TreeFile file = TreeFile::parse(bytes_of(tree));
        file["parents"].set(leaf, parent);
        support::write_bytes(file_, file.bytes());
        const auto mapped = require(map_tree(file_));
        Cut cut(*mapped);
        EXPECT_FALSE(cut.is_active(leaf));
        cut.unfold_ancestors(leaf);
        EXPECT_FALSE(cut.is_active(leaf)); // the true parent is damaged
        EXPECT_TRUE(cut.is_active(cut.proxy_of_leaf(support::first_leaf_of(tree, leaf))));
    }
}

TEST_F(TreeIo, KeepsAMappedTreeWhoseFileIsReplaced) {
    const VertexTree tree = built(shapes::bumpy_sphere(4)), other = built(shapes::cube(2));
    ASSERT_TRUE(write_tree(file_, tree));
    const auto mapped = require(map_tree(file_));
    ASSERT_TRUE(write_tree(file_, other)); // by renaming
    EXPECT_EQ(support::difference(tree, *mapped), "");
    auto relit = require(mapped->relit({.direction = {0, 0, 1}}));
    std::filesystem::remove(file_);
    EXPECT_TRUE(verify(*relit));
}

TEST_F(TreeIo, MapsNoSectionAcrossAnElement) {
    // The offset of a section raised by one element, within the file: read, its checksum fails; mapped, it is
    // misaligned.
    std::string bytes = bytes_of(built(shapes::cube(2)));
    const std::size_t at = TreeFile::header_bytes + TreeFile::offset_at;
    support::store(bytes, at, support::load<std::uint64_t>(bytes, at) + 4);
    TreeFile::seal(bytes);
    support::write_bytes(file_, bytes);
    EXPECT_THAT(error_in(map_tree(file_)), HasSubstr("multiple of 64"));
}

TEST_F(TreeIo, ReportsMissingFilesAndFolders) {
    const auto missing = read_tree(folder_ / "nothing.vdt");
    ASSERT_FALSE(missing);
    EXPECT_EQ(missing.error().code, ErrorCode::io_failure);
    EXPECT_THAT(missing.error().message, HasSubstr("nothing.vdt"));
    EXPECT_FALSE(read_tree(folder_.path()));
    EXPECT_FALSE(map_tree(folder_.path()));
    EXPECT_FALSE(map_tree(folder_ / "nothing.vdt"));
    EXPECT_FALSE(is_tree_file(folder_ / "nothing.vdt"));
    EXPECT_FALSE(is_tree_file(folder_.path()));

    const VertexTree tree = built(shapes::cube(1));
    EXPECT_THAT(error_in(write_tree(folder_ / "no" / "such" / "tree.vdt", tree)), HasSubstr("tree.vdt"));
    EXPECT_FALSE(write_tree(folder_.path(), tree));
    EXPECT_EQ(folder_.file_count(), 0u);
}

TEST_F(TreeIo, DoesNotWaitForPipes) {
    const auto pipe = folder_ / "pipe.vdt";
    ASSERT_EQ(::mkfifo(pipe.c_str(), 0600), 0);
    EXPECT_FALSE(read_tree(pipe)); // would wait for a writer for ever
    EXPECT_FALSE(map_tree(pipe));
    EXPECT_FALSE(is_tree_file(pipe));
}

TEST_F(TreeIo, LeavesNothingInAFolderThatCannotBeWritten) {
    if (::geteuid() == 0) GTEST_SKIP() << "root may write everywhere";
    std::filesystem::permissions(folder_.path(),
                                 std::filesystem::perms::owner_read | std::filesystem::perms::owner_exec);
    EXPECT_FALSE(write_tree(file_, built(shapes::cube(1))));
    EXPECT_EQ(folder_.file_count(), 0u);
}

TEST_F(TreeIo, KeepsTheOldFileWhenTheDiskIsFull) {
    const VertexTree tree = built(shapes::bumpy_sphere(3));
    support::write_bytes(file_, "old");
    rlimit before{};
    ASSERT_EQ(::getrlimit(RLIMIT_FSIZE, &before), 0);
    const auto handler = std::signal(SIGXFSZ, SIG_IGN);
    rlimit small = before;
    small.rlim_cur = 10'000;
    ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &small), 0);
    const auto written = write_tree(file_, tree);
    ASSERT_EQ(::setrlimit(RLIMIT_FSIZE, &before), 0);
    std::signal(SIGXFSZ, handler);
    EXPECT_FALSE(written);
    EXPECT_EQ(support::read_bytes(file_), "old");
    EXPECT_EQ(folder_.file_count(), 1u);
}

TEST_F(TreeIo, CanBeCancelledAtAnyTime) {
    const VertexTree tree = built(shapes::cube(2));
    support::write_bytes(file_, "old");
    bool cancelled = true;
    for (int calls = 0; cancelled; ++calls) {
        int left = calls;
        const auto stop = [&](double share, const char*) {
            EXPECT_GE(share, 0);
            EXPECT_LE(share, 1);
            return left-- > 0;
        };
        const auto written = write_tree(file_, tree, stop);
        cancelled = !written;
        if (!cancelled) break;
        ASSERT_EQ(written.error().code, ErrorCode::cancelled);
        ASSERT_EQ(support::read_bytes(file_), "old");
        ASSERT_EQ(folder_.file_count(), 1u);
        ASSERT_LT(calls, 1000);
    }
    cancelled = true;
    for (int calls = 0; cancelled; ++calls) {
        int left = calls;
        const auto stop = [&](double, const char*) { return left-- > 0; };
        const auto read = read_tree(file_, stop);
        cancelled = !read;
        ASSERT_TRUE(read || read.error().code == ErrorCode::cancelled);
        ASSERT_LT(calls, 1000);
    }
}

} // namespace unseen::vdtree::tree_io_test
