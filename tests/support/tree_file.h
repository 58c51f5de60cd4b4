// Tree files (.vdt) taken apart and put together again with valid checksums, from docs/file-format.md and not from
// the writer's code: for files that lie, and as a second opinion about the format. For little-endian hosts.
#pragma once

#include <algorithm>
#include <cstdint>
#include <cstring>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#define XXH_INLINE_ALL
#include <xxhash.h>

namespace unseen::support {

template <class T>
T load(std::string_view bytes, std::size_t at) {
    if (bytes.size() < sizeof(T) || at > bytes.size() - sizeof(T)) throw std::out_of_range("load");
    T value;
    std::memcpy(&value, bytes.data() + at, sizeof value);
    return value;
}

template <class T>
void store(std::string& bytes, std::size_t at, T value) {
    if (bytes.size() < sizeof(T) || at > bytes.size() - sizeof(T)) throw std::out_of_range("store");
    std::memcpy(bytes.data() + at, &value, sizeof value);
}

inline std::uint64_t xxh3(std::string_view bytes) { return XXH3_64bits(bytes.data(), bytes.size()); }

struct TreeFile {
    static constexpr std::size_t header_bytes = 48, entry_bytes = 48, page_bytes = 1 << 20, alignment = 64,
                                 most_sections = 64;
    // Offsets in the header and in an entry of the section table.
    static constexpr std::size_t version_at = 8, section_count_at = 12, file_bytes_at = 16, page_count_at = 24,
                                 table_checksum_at = 32, header_checksum_at = 40;
    static constexpr std::size_t domain_at = 20, element_bytes_at = 24, component_bytes_at = 28, count_at = 32,
                                 offset_at = 40;

    struct Section {
        std::string name;
        std::uint32_t element_bytes = 1, component_bytes = 1;
        std::string data;
        std::uint32_t domain = 0; // 1, 2 and 3: of an attribute

        template <class T>
        T get(std::size_t i) const {
            return load<T>(data, i * sizeof(T));
        }
        template <class T>
        void set(std::size_t i, T value) {
            store(data, i * sizeof(T), value);
        }
        std::uint64_t count() const { return data.size() / element_bytes; }
    };
    std::vector<Section> sections;

    static TreeFile parse(std::string_view bytes) {
        TreeFile file;
        const auto count = load<std::uint32_t>(bytes, section_count_at);
        if (count > most_sections) throw std::out_of_range("section count");
        for (std::uint32_t i = 0; i < count; ++i) {
            const std::size_t entry = header_bytes + i * entry_bytes;
            Section s;
            s.name = std::string(bytes.substr(entry, domain_at));
            s.name.resize(std::strlen(s.name.c_str()));
            s.domain = load<std::uint32_t>(bytes, entry + domain_at);
            s.element_bytes = load<std::uint32_t>(bytes, entry + element_bytes_at);
            s.component_bytes = load<std::uint32_t>(bytes, entry + component_bytes_at);
            if (s.element_bytes == 0) throw std::out_of_range("element size");
            s.data = std::string(bytes.substr(load<std::uint64_t>(bytes, entry + offset_at),
                                              load<std::uint64_t>(bytes, entry + count_at) * s.element_bytes));
            file.sections.push_back(std::move(s));
        }
        return file;
    }

    Section& operator[](std::string_view name) {
        for (Section& s : sections)
            if (s.name == name) return s;
        throw std::out_of_range("no section " + std::string(name));
    }

    std::string bytes() const {
        std::vector<std::uint64_t> checksums;
        for (const Section& s : sections)
            for (std::size_t at = 0; at < s.data.size(); at += page_bytes)
                checksums.push_back(xxh3(std::string_view(s.data).substr(at, page_bytes)));
        std::string out(header_bytes + sections.size() * entry_bytes, '\0');
        std::memcpy(out.data(), "UNSEENVT", 8);
        store(out, version_at, std::uint32_t{7});
        store(out, section_count_at, static_cast<std::uint32_t>(sections.size()));
        store(out, page_count_at, std::uint64_t{checksums.size()});
        for (const std::uint64_t sum : checksums) {
            out.resize(out.size() + 8);
            store(out, out.size() - 8, sum);
        }
        for (std::size_t i = 0; i < sections.size(); ++i) {
            const Section& s = sections[i];
            const std::size_t entry = header_bytes + i * entry_bytes;
            out.resize((out.size() + alignment - 1) / alignment * alignment);
            std::memcpy(out.data() + entry, s.name.data(), std::min(s.name.size(), domain_at));
            store(out, entry + domain_at, s.domain);
            store(out, entry + element_bytes_at, s.element_bytes);
            store(out, entry + component_bytes_at, s.component_bytes);
            store(out, entry + count_at, s.count());
            store(out, entry + offset_at, std::uint64_t{out.size()});
            out += s.data;
        }
        store(out, file_bytes_at, std::uint64_t{out.size()});
        seal(out);
        return out;
    }

    // Makes the checksums of header and table right again, whatever they now say.
    static void seal(std::string& bytes) {
        if (bytes.size() < header_bytes) return;
        const std::uint64_t table = std::uint64_t{load<std::uint32_t>(bytes, section_count_at)} * entry_bytes;
        const std::uint64_t pages = load<std::uint64_t>(bytes, page_count_at);
        const std::uint64_t room = bytes.size() - header_bytes;
        if (table <= room && pages <= (room - table) / 8) {
            const auto covered = std::string_view(bytes).substr(header_bytes, table + pages * 8);
            store(bytes, table_checksum_at, xxh3(covered));
        }
        store(bytes, header_checksum_at, xxh3(std::string_view(bytes).substr(0, header_checksum_at)));
    }
};

} // namespace unseen::support
