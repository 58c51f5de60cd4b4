// Digits of base64.
#pragma once

namespace unseen::meshio {

// 0 to 63, or -1.
constexpr int base64_value(char c) {
    if (c >= 'A' && c <= 'Z') return c - 'A';
    if (c >= 'a' && c <= 'z') return c - 'a' + 26;
    if (c >= '0' && c <= '9') return c - '0' + 52;
    if (c == '+' || c == '-') return 62; // the second of each pair: RFC 4648's alphabet for URLs
    if (c == '/' || c == '_') return 63;
    return -1;
}

} // namespace unseen::meshio
