// sommerl.hpp: reads, evaluates and samples measured materials that Sommerl has compressed (.smrl, .smrlib, .fbrdf).
//
// One header, C++17, no dependencies. It is written by hand; docs/format.md specifies what it reads, docs/cpp.md how it is used.
//
//     auto brdf = sommerl::Brdf::load("gold.smrl");       // or load(bytes, size)
//     if (!brdf) { std::puts(sommerl::message(brdf.error())); return 1; }
//     auto f_r = brdf.eval({0, 0, 1}, {0.6f, 0, 0.8f});    // [1/sr], linear RGB, without the cosine
//
// Directions are unit vectors in the surface frame, z along the normal; wi points to the light, wo to the viewer.
// Nothing is thrown: what cannot be read gives an error code. SOMMERL_NO_EXCEPTIONS leaves out the one `try` that turns a lack of
// memory into such a code; it is set where exceptions are switched off. After `load`, all calls are safe from many threads.
// SPDX-License-Identifier: MIT
#ifndef SOMMERL_HPP
#define SOMMERL_HPP

#include <array>
#include <atomic>
#include <cfloat>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <limits>
#include <memory>
#include <new>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#if !defined(SOMMERL_NO_EXCEPTIONS) && !defined(__cpp_exceptions) && !defined(_CPPUNWIND)
#define SOMMERL_NO_EXCEPTIONS
#endif
#if defined(__FAST_MATH__) || defined(_M_FP_FAST) || FLT_EVAL_METHOD == 1 || FLT_EVAL_METHOD == 2
#error "sommerl.hpp: compile what includes it without -ffast-math, for arithmetic of IEEE 754: files are decoded with it"
#endif
#if defined(__clang__)  // fused multiply-add would decode files to other numbers
#define SOMMERL_EXACT _Pragma("clang fp contract(off)")
#else
#define SOMMERL_EXACT
#endif

namespace sommerl {

enum class Error : std::uint8_t {
    none, not_loaded, file, memory, kind, version, checksum, truncated, name, notes, contents, stream, missing
};

/// What went wrong, as one sentence.
inline const char* message(Error error) {
    constexpr const char* sentences[] = {
        "no error",
        "expected a material that was loaded, found none",
        "expected a file that can be read, found none",
        "expected enough memory, found too little",
        "expected a file of Sommerl's (.smrl, .smrlib, .fbrdf) of the asked kind, found another",
        "expected a known version of the format, found another; a newer sommerl.hpp may read it",
        "expected the checksum in the file, found another: the file is damaged or cut off",
        "expected more bytes, found the end of the file",
        "expected names in UTF-8, sorted and of a bounded length, found others",
        "expected notes of plain JSON, found others",
        "expected counts, flags and values within their bounds, found others",
        "expected a compressed stream that ends with the file, found another",
        "expected a material of that name in the library, found none",
    };
    return sentences[static_cast<std::size_t>(error)];
}

enum class Kind : std::uint8_t { cells, nodes, factored };

namespace detail {

constexpr double pi = 3.14159265358979323846;
constexpr std::size_t most_cells = std::size_t(1) << 22, longest_file = 2 * most_cells + 24 * 65536 + (1 << 20);

inline bool failed(Error error) { return error != Error::none; }

struct Bytes {
    const std::uint8_t* data = nullptr;
    std::size_t size = 0;
    Bytes part(std::size_t at, std::size_t count) const { return {data + at, count}; }
    std::string_view text() const { return {reinterpret_cast<const char*>(data), size}; }
};

/// Reads bytes one part after the other. Once too few are left, all that is read is empty, or 0.
class Reader {
public:
    explicit Reader(Bytes bytes) : rest_(bytes) {}
    bool fine() const { return fine_; }
    Bytes rest() const { return rest_; }
    Bytes take(std::size_t count) {
        fine_ = fine_ && count <= rest_.size;
        if (!fine_) return {};
        const Bytes taken = rest_.part(0, count);
        rest_ = rest_.part(count, rest_.size - count);
        return taken;
    }
    std::uint64_t number(std::size_t count) {
        const Bytes bytes = take(count);
        std::uint64_t sum = 0;
        for (std::size_t i = bytes.size; i > 0; --i) sum = sum << 8 | bytes.data[i - 1];
        return sum;
    }
    std::size_t size(std::size_t count) { return static_cast<std::size_t>(number(count)); }
    float real() {
        const auto bits = static_cast<std::uint32_t>(number(4));
        float value;
        std::memcpy(&value, &bits, 4);
        return value;
    }
private:
    Bytes rest_;
    bool fine_ = true;
};

inline std::uint32_t crc32(Bytes bytes) {
    static const std::array<std::uint32_t, 256> table = [] {
        std::array<std::uint32_t, 256> made{};
        for (std::uint32_t i = 0; i < 256; ++i) {
            std::uint32_t x = i;
            for (int bit = 0; bit < 8; ++bit) x = x & 1 ? x >> 1 ^ 0xedb88320u : x >> 1;
            made[i] = x;
        }
        return made;
    }();
    std::uint32_t crc = ~0u;
    for (std::size_t i = 0; i < bytes.size; ++i) crc = crc >> 8 ^ table[(crc ^ bytes.data[i]) & 255];
    return ~crc;
}

inline bool is_utf8(std::string_view text) {
    for (std::size_t i = 0; i < text.size();) {
        const auto byte = [&](std::size_t at) -> std::uint32_t { return at < text.size() ? static_cast<unsigned char>(text[at]) : 0u; };
        const std::uint32_t first = byte(i);
        const std::size_t more = first < 0x80 ? 0 : first < 0xe0 ? 1 : first < 0xf0 ? 2 : 3;
        std::uint32_t code = more ? first & (0x3fu >> more) : first;
        if (more && (first < 0xc2 || first > 0xf4)) return false;
        for (std::size_t k = 1; k <= more; ++k) {
            if ((byte(i + k) & 0xc0) != 0x80) return false;
            code = code << 6 | (byte(i + k) & 0x3f);
        }
        constexpr std::uint32_t least[] = {0, 0x80, 0x800, 0x10000};
        if (code < least[more] || code > 0x10ffff || (code >= 0xd800 && code < 0xe000)) return false;
        i += more + 1;
    }
    return true;
}

inline std::string hexadecimal(Bytes bytes) {
    std::string text;
    for (std::size_t i = 0; i < bytes.size; ++i) {
        text += "0123456789abcdef"[bytes.data[i] >> 4];
        text += "0123456789abcdef"[bytes.data[i] & 15];
    }
    return text;
}

/// Inflates a deflate stream (RFC 1951), to exactly as many bytes as there is room for, and to its last byte.
class Inflater {
public:
    static bool inflate(Bytes stream, std::vector<std::uint8_t>& room) {
        Inflater inflater(stream, room);
        for (bool last = false; inflater.fine_ && !last;) {
            last = inflater.bits(1);
            inflater.block(inflater.bits(2));
        }
        return inflater.fine_ && inflater.at_ == room.size() && inflater.read_ == stream.size;
    }
private:
    struct Code {  // a canonical Huffman code: how many symbols have each length, and all symbols in order
        std::array<std::uint16_t, 16> counts{};
        std::array<std::uint16_t, 288> symbols{};
    };
    using Lengths = std::array<std::uint8_t, 320>;
    Inflater(Bytes stream, std::vector<std::uint8_t>& room) : stream_(stream), room_(room) {}
    unsigned bits(unsigned count) {
        for (; held_ < count; held_ += 8) {
            fine_ = fine_ && read_ < stream_.size;
            hold_ |= std::uint32_t(fine_ ? stream_.data[read_++] : 0) << held_;
        }
        const unsigned value = hold_ & ((1u << count) - 1);
        hold_ >>= count;
        held_ -= count;
        return value;
    }
    unsigned symbol(const Code& code) {
        std::uint32_t number = 0, first = 0, before = 0;  // the code read, the first of its length, shorter ones
        for (std::size_t length = 1; length < 16 && fine_; ++length) {
            number = number << 1 | bits(1);
            first <<= 1;
            if (number - first < code.counts[length]) return code.symbols[before + number - first];
            first += code.counts[length];
            before += code.counts[length];
        }
        fine_ = false;
        return 0;
    }
    /// Lengths may ask for as many codes as there are; or for one or none, where that is allowed.
    Code made(const std::uint8_t* lengths, std::size_t count, bool few) {
        Code code;
        std::array<std::uint16_t, 16> at{};
        for (std::size_t i = 0; i < count; ++i) ++code.counts[lengths[i]];
        few = code.counts[0] == count || (few && code.counts[0] + 1u == count && code.counts[1] == 1);
        code.counts[0] = 0;
        int left = 1;
        for (std::size_t length = 1; length < 16; ++length) {
            left = 2 * left - code.counts[length];
            fine_ = fine_ && left >= 0;
            at[length] = static_cast<std::uint16_t>(at[length - 1] + code.counts[length - 1]);
        }
        fine_ = fine_ && (left == 0 || few);
        for (std::size_t i = 0; i < count && fine_; ++i)
            if (lengths[i]) code.symbols[at[lengths[i]]++] = static_cast<std::uint16_t>(i);
        return code;
    }
    void block(unsigned kind) {
        Lengths lengths{};
        std::size_t literals = 288, distances = 32;
        if (kind == 0) return stored();
        if (kind == 1) for (std::size_t i = 0; i < 320; ++i) lengths[i] = i < 144 ? 8 : i < 256 ? 9 : i < 280 ? 7 : i < 288 ? 8 : 5;
        else if (kind == 2) read_lengths(lengths, literals, distances);
        else fine_ = false;
        if (!fine_) return;
        const Code literal = made(lengths.data(), literals, true), distance = made(lengths.data() + literals, distances, true);
        while (fine_) {
            const unsigned found = symbol(literal);
            if (!fine_ || found == 256) return;
            if (found > 256) copy(found - 257, distance);
            else put(static_cast<std::uint8_t>(found));
        }
    }
    void read_lengths(Lengths& lengths, std::size_t& literals, std::size_t& distances) {
        literals = 257 + bits(5);
        distances = 1 + bits(5);
        fine_ = fine_ && literals <= 286 && distances <= 30;
        std::array<std::uint8_t, 19> own{};
        for (unsigned i = 0, count = 4 + bits(4); i < count; ++i)
            own[static_cast<std::size_t>("\20\21\22\0\10\7\11\6\12\5\13\4\14\3\15\2\16\1\17"[i])] = static_cast<std::uint8_t>(bits(3));
        const Code code = made(own.data(), own.size(), false);
        for (std::size_t i = 0; fine_ && i < literals + distances;) {
            const unsigned found = symbol(code);
            const auto length = found < 16 ? static_cast<std::uint8_t>(found) : found == 16 && i ? lengths[i - 1] : std::uint8_t(0);
            const std::size_t times = found < 16 ? 1 : found == 16 ? 3 + bits(2) : found == 17 ? 3 + bits(3) : 11 + bits(7);
            fine_ = fine_ && (found != 16 || i) && i + times <= literals + distances;
            for (std::size_t n = 0; fine_ && n < times; ++n) lengths[i++] = length;
        }
        fine_ = fine_ && lengths[256] != 0;
    }
    void stored() {
        hold_ = held_ = 0;
        const unsigned length = bits(16), other = bits(16);
        fine_ = fine_ && length == (other ^ 0xffffu) && length <= stream_.size - read_;
        for (unsigned i = 0; fine_ && i < length; ++i) put(stream_.data[read_++]);
    }
    void put(std::uint8_t byte) {
        fine_ = fine_ && at_ < room_.size();
        if (fine_) room_[at_++] = byte;
    }
    void copy(unsigned number, const Code& distances) {
        std::size_t length = number == 28 ? 258 : 3 + number;
        if (number > 7 && number < 28) length = 3 + ((4u + (number & 3)) << (number / 4 - 1)) + bits(number / 4 - 1);
        const unsigned far_number = symbol(distances);
        fine_ = fine_ && number <= 28 && far_number <= 29;
        std::size_t back = 1 + far_number;
        if (fine_ && far_number > 3) back = 1 + ((2u + (far_number & 1)) << (far_number / 2 - 1)) + bits(far_number / 2 - 1);
        fine_ = fine_ && back <= at_;
        for (; fine_ && length > 0; --length) put(room_[at_ - back]);
    }
    Bytes stream_;
    std::vector<std::uint8_t>& room_;
    std::size_t read_ = 0, at_ = 0;
    std::uint32_t hold_ = 0;
    unsigned held_ = 0;
    bool fine_ = true;
};

/// Walks through a text of JSON, whose bytes are UTF-8. All functions say whether it is as it should be.
class Json {
public:
    explicit Json(std::string_view text) : text_(text) {}
    std::string_view rest() const { return text_; }
    char next() {
        while (!text_.empty() && std::string_view(" \t\r\n").find(text_[0]) != std::string_view::npos) text_.remove_prefix(1);
        return text_.empty() ? '\0' : text_[0];
    }
    bool ends() { return next() == '\0' && text_.empty(); }
    bool token(char wanted) {
        const bool found = next() == wanted && !text_.empty();
        if (found) text_.remove_prefix(1);
        return found;
    }
    /// A value whose objects and lists lie in each other at most so deep.
    bool value(int deepest) {
        if (next() == '{') return deepest > 0 && object([&](std::string_view) { return value(deepest - 1); });
        if (next() == '[') return deepest > 0 && list([&] { return value(deepest - 1); });
        std::string_view text;
        if (next() == '"') return string(text) && text.size() <= 1u << 16;
        for (const std::string_view word : {"true", "false", "null"})
            if (text_.substr(0, word.size()) == word) return text_.remove_prefix(word.size()), true;
        return number();
    }
    /// 64 names of at most 100 characters, with numbers, words, and texts of at most 1000 characters; one name may hold such an object.
    bool plain(std::string_view with_object = {}) {
        int count = 0;
        return object([&](std::string_view key) {
            if (!with_object.empty() && key == with_object) return plain();
            std::string_view text = next() == '"' ? text_ : std::string_view();
            const bool fits = value(0);
            text.remove_suffix(text.empty() ? 0 : text_.size());
            return fits && ++count <= 64 && length(key) <= 100 && length(text) <= 1002;  // with its quotes
        });
    }
    template <class Member> bool object(Member member) {
        if (!token('{')) return false;
        if (token('}')) return true;
        std::string_view key;
        do {
            if (!string(key) || !token(':') || !member(key)) return false;
        } while (token(','));
        return token('}');
    }
    template <class Item> bool list(Item item) {
        if (!token('[')) return false;
        if (token(']')) return true;
        do {
            if (!item()) return false;
        } while (token(','));
        return token(']');
    }
    /// text: what is between the quotes, as it is written.
    bool string(std::string_view& text) {
        if (!token('"')) return false;
        for (std::size_t i = 0; i < text_.size() && static_cast<unsigned char>(text_[i]) >= 0x20; ++i) {
            if (text_[i] == '"') {
                text = text_.substr(0, i);
                text_.remove_prefix(i + 1);
                return true;
            }
            if (text_[i] != '\\') continue;
            const char name = ++i < text_.size() ? text_[i] : '\0';
            if (name != 'u' && !is_in("\"\\/bfnrt", name)) return false;
            for (int n = name == 'u' ? 4 : 0; n > 0; --n)
                if (++i >= text_.size() || !is_in("0123456789abcdefABCDEF", text_[i])) return false;
        }
        return false;
    }
    /// The characters of a text in UTF-8.
    static std::size_t length(std::string_view text) {
        std::size_t count = 0;
        for (const char c : text) count += (static_cast<unsigned char>(c) & 0xc0) != 0x80;
        return count;
    }
private:
    static bool is_in(std::string_view characters, char c) { return characters.find(c) != std::string_view::npos; }
    std::size_t digits() {
        std::size_t count = 0;
        for (; !text_.empty() && text_[0] >= '0' && text_[0] <= '9'; ++count) text_.remove_prefix(1);
        return count;
    }
    bool number() {  // up to about 10^300
        const auto skip = [&](std::string_view any) { return !text_.empty() && is_in(any, text_[0]) && (text_.remove_prefix(1), true); };
        skip("-");
        const bool zero = !text_.empty() && text_[0] == '0';
        const std::size_t whole = digits();
        if (whole == 0 || whole > 301 || (zero && whole > 1) || (skip(".") && digits() == 0)) return false;
        if (!skip("eE")) return true;
        const bool small_one = !text_.empty() && text_[0] == '-';
        skip("+-");
        while (text_.size() > 1 && text_[0] == '0' && digits_follow()) text_.remove_prefix(1);
        std::size_t power = 0;
        const std::string_view start = text_;
        const std::size_t count = digits();
        for (std::size_t i = 0; i < count && i < 4; ++i) power = 10 * power + static_cast<std::size_t>(start[i] - '0');
        return count > 0 && (small_one || power + whole <= 301);
    }
    bool digits_follow() const { return text_[1] >= '0' && text_[1] <= '9'; }
    std::string_view text_;
};

/// Notes: of the names that they may have, `options` and `metrics` are plain.
inline bool notes_are_fine(std::string_view text) {
    Json json(text);
    const auto member = [&](std::string_view key) {
        return key == "options" ? json.plain("source_facts") : key == "metrics" ? json.plain() : json.value(31);
    };
    return is_utf8(text) && (text.empty() || (json.object(member) && json.ends()));
}

constexpr int fine = 180;

/// Places of nodes on the fine grid. Rows of equal θ_h form bands, which share their places in θ_d and φ_d.
struct Lattice {
    std::vector<std::uint8_t> theta_h, band;
    std::vector<std::vector<std::uint8_t>> theta_d, phi_d;
    bool reciprocal = true, mirrored = false;
    std::size_t nodes() const {
        std::size_t sum = 0;
        for (const auto b : band) sum += theta_d[b].size() * phi_d[b].size();
        return sum;
    }
};

/// All that a file says of a material.
struct Material {
    Kind kind = Kind::nodes;
    std::string name, source_sha256, notes;
    bool reciprocal = true, mirrored = false, is_signed = false, smooth = false, trilinear = true;
    std::vector<double> palette;  // triples: LUT entries of cells, shapes of nodes
    std::array<std::uint32_t, 3> bins{};
    std::vector<std::uint8_t> narrow;  // the entry of each cell: in 8 bits, or else in `wide`
    std::vector<std::uint16_t> wide;
    Lattice lattice;
    double scale = 1;
    std::vector<double> gains;
    std::vector<std::uint16_t> gain, shape;  // of each node
    unsigned lobes = 0, terms = 0;
    std::vector<float> f, u, v;  // u times the scale of its term
};

/// What the model of a stream begins with.
struct Prior {
    std::array<std::array<double, 10>, 3> weights{};
    std::array<double, 3> levels{};
};

/// The range decoder, and numbers that are coded with it.
class Decoder {
public:
    using Context = std::array<std::uint32_t, 24>;
    static Context context() {
        Context made;
        made.fill(2048);
        return made;
    }
    explicit Decoder(Bytes stream) : stream_(stream) {
        for (int i = 0; i < 4; ++i) shift();
    }
    bool lost() const { return lost_; }
    /// weights: of all symbols; those before `first` and from `end` on are 1.
    std::uint32_t pick(const std::uint32_t* weights, std::uint32_t total, std::uint32_t first, std::uint32_t end) {
        const std::uint32_t share = range_ / total, at = code_ / share;
        if (at >= total) lost_ = true;
        if (lost_) return 0;
        std::uint32_t symbol = at, below = at, weight = 1;
        if (at >= first) {
            symbol = below = first;
            while (symbol < end && below + weights[symbol] <= at) below += weights[symbol++];
            if (symbol < end) weight = weights[symbol];
            else symbol = end + (at - below), below = at;
        }
        code_ -= share * below;
        range_ = share * weight;
        while (range_ < 1u << 24) {
            range_ <<= 8;
            shift();
        }
        return symbol;
    }
    std::uint32_t number(Context& context) {
        std::size_t n = 0;
        while (n < 20 && bit(context[n])) ++n;
        std::uint32_t x = 1, even = 2048;
        for (std::size_t i = n; i > 0; --i, even = 2048) x = 2 * x + bit(i == n && i <= 4 ? context[19 + i] : even);
        return x - 1;
    }
    std::int32_t signed_number(Context& context) {
        const auto x = static_cast<std::int32_t>(number(context));
        return x % 2 ? -((x + 1) / 2) : x / 2;
    }
    /// Whether this is the stream that a writer gives.
    bool ends() const {
        const std::uint64_t low = window_ - code_, last = low + range_ - 1;
        int k = 32;
        while ((last >> k << k) < low) --k;
        const bool whole = read_ >= stream_.size && (stream_.size == 0 || stream_.data[stream_.size - 1] != 0);
        return !lost_ && whole && static_cast<std::uint32_t>(last >> k << k) == window_;
    }
private:
    std::uint32_t bit(std::uint32_t& one) {
        const std::uint32_t weights[] = {4096 - one, one};
        const std::uint32_t found = pick(weights, 4096, 0, 2);
        one = found ? one + ((4096 - one) >> 4) : one - (one >> 4);
        return found;
    }
    void shift() {
        const std::uint32_t byte = read_ < stream_.size ? stream_.data[read_] : 0;
        ++read_;
        code_ = code_ << 8 | byte;
        window_ = window_ << 8 | byte;
    }
    Bytes stream_;
    std::size_t read_ = 0;
    std::uint32_t range_ = ~0u, code_ = 0, window_ = 0;
    bool lost_ = false;
};

#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC push_options
#pragma GCC optimize("fp-contract=off")
#endif

/// Predicts one coordinate of nodes from their neighbours by recursive least squares. Names are those of docs/format.md.
class Predictor {
public:
    explicit Predictor(const std::vector<double>& values) {
        SOMMERL_EXACT
        double mean = 0, variance = 0;
        const auto n = static_cast<double>(values.size());
        for (const double value : values) mean += value;
        mean /= n;
        for (const double value : values) variance += (value - mean) * (value - mean);
        variance = variance / n + 1e-4;
        for (std::size_t i = 0; i < 10; ++i) matrix_[i][i] = 25.0 / variance;
        level_ = 0.15 * std::sqrt(variance);
    }
    void begin_with(const std::array<double, 10>& weights, double level) {
        w_ = weights;
        level_ = level;
        for (auto& row : matrix_)
            for (double& entry : row) entry = 0.1 * entry;
    }
    void predict(double up, const double (&values)[10], const double (&errors)[3], int count) {
        SOMMERL_EXACT
        double predicted = up, sum = 0.7 * level_, weight = 0.7;
        for (std::size_t i = 0; i < 10; ++i) {
            x_[i] = values[i] - up;
            predicted += w_[i] * x_[i];
        }
        for (int i = 0; i < count; ++i) sum += errors[i], weight += 1.0;
        predicted_ = predicted;
        s_ = 1.0 / (sum / weight + 0.02 * level_ + 1e-4);
    }
    double predicted() const { return predicted_; }
    double s() const { return s_; }
    double learn(double value) {
        SOMMERL_EXACT
        const double error = value - predicted_, size = std::fabs(error);
        double g[10] = {}, power = 1.0;
        for (std::size_t i = 0; i < 10; ++i)
            for (std::size_t j = 0; j < 10; ++j) g[j] += matrix_[i][j] * x_[i];
        for (std::size_t i = 0; i < 10; ++i) power += g[i] * x_[i];
        const double r = 1.0 / power;
        for (std::size_t i = 0; i < 10; ++i) {
            w_[i] += g[i] * r * error;
            for (std::size_t j = 0; j < 10; ++j) matrix_[i][j] = (matrix_[i][j] - g[i] * g[j] * r) * 1.0005;
        }
        level_ = 0.98 * level_ + 0.02 * size;
        return size;
    }
private:
    std::array<double, 10> w_{0.5, 0.5, 0, 0, -0.5, -0.5, 0, 0, 0, 0}, x_{};
    double matrix_[10][10] = {};
    double level_, predicted_ = 0, s_ = 1;
};

/// The gains, or the shapes, of a palette: their places, and their weights for the next node.
class Entries {
public:
    Entries(const std::vector<double>& first, const std::vector<double>& second) : n_(first.size()), before_(4098) {
        for (auto* each : {&first_, &second_, &roots_, &counts_, &narrow_heights_, &wide_heights_}) each->assign(n_, 1.0);
        for (std::size_t i = 0; i < n_; ++i) first_[i] = first[i], second_[i] = second[i], ++before_[step(first[i]) + 1];
        for (std::size_t i = 1; i < before_.size(); ++i) before_[i] += before_[i - 1];
        weights_.assign(n_, 1);
    }
    void weigh(double p0, double s0, double p1, double s1) {
        SOMMERL_EXACT
        p0_ = p0, s0_ = s0, p1_ = p1, s1_ = s1;
        const double reach = 16.0 / s0;
        first_reached_ = before_[step(p0 - reach)];
        end_reached_ = before_[step(p0 + reach) + 1];
        if (end_reached_ < first_reached_) end_reached_ = first_reached_;
        const std::size_t start = first_reached_, count = end_reached_ - first_reached_;
        reached_ += count;
        const double *first = first_.data() + start, *second = second_.data() + start, *roots = roots_.data() + start;
        double *slim = narrow_heights_.data(), *broad = wide_heights_.data();
        double slims[4] = {}, broads[4] = {};
        std::size_t i = 0;
        for (; i + 4 <= count; i += 4) {
            for (std::size_t l = 0; l < 4; ++l) {
                kernels(roots[i + l], (first[i + l] - p0) * s0, (second[i + l] - p1) * s1, slim[i + l], broad[i + l]);
                slims[l] += slim[i + l];
                broads[l] += broad[i + l];
            }
        }
        for (std::size_t l = 0; i < count; ++i, ++l) {
            kernels(roots[i], (first[i] - p0) * s0, (second[i] - p1) * s1, slim[i], broad[i]);
            slims[l] += slim[i];
            broads[l] += broad[i];
        }
        f_ = share_ / ((slims[0] + slims[1]) + (slims[2] + slims[3]) + 1e-300);
        g_ = (1.0 - share_) / ((broads[0] + broads[1]) + (broads[2] + broads[3]) + 1e-300);
        const double f = f_ * 65536.0, g = g_ * 65536.0;
        std::uint32_t* weights = weights_.data() + start;
        total_ = static_cast<std::uint32_t>(n_);
        for (i = 0; i < count; ++i) {
            const double more = slim[i] * f + broad[i] * g;  // at most 65536, but for rounding
            const auto whole = static_cast<std::int32_t>(more > 0.0 ? more : 0.0);
            weights[i] = static_cast<std::uint32_t>(1 + whole);
            total_ += static_cast<std::uint32_t>(whole);
        }
    }
    std::uint32_t picked(Decoder& coder) const { return coder.pick(weights_.data(), total_, first_reached_, end_reached_); }
    void learn(std::size_t entry) {
        SOMMERL_EXACT
        double slim, broad;
        kernels(roots_[entry], (first_[entry] - p0_) * s0_, (second_[entry] - p1_) * s1_, slim, broad);
        slim *= f_;
        broad *= g_;
        share_ = 0.96 * (slim / (slim + broad)) + 0.02;
        counts_[entry] += 1.0;
        roots_[entry] = std::sqrt(counts_[entry]);
    }
    double place(int coordinate, std::size_t entry) const { return coordinate ? second_[entry] : first_[entry]; }
    std::size_t reached() const { return reached_; }
private:
    static std::size_t step(double place) {
        const double steps = place * 64.0 + 2048.0, above = steps > 0.0 ? steps : 0.0;
        return static_cast<std::size_t>(above < 4096.0 ? above : 4096.0);
    }
    static void kernels(double root, double x, double y, double& slim, double& broad) {
        SOMMERL_EXACT
        x = x * x;
        y = y * y;
        double a = (1.0 + x * 2.25) * (1.0 + y * 2.25), b = (1.0 + x * 0.25) * (1.0 + y * 0.25);
        a = a * a;
        b = b * b;
        const double both = root / (a * b);
        slim = both * b;
        broad = both * a;
    }
    std::size_t n_, reached_ = 0;
    std::vector<double> first_, second_, roots_, counts_, narrow_heights_, wide_heights_;
    std::vector<std::uint16_t> before_;  // for each step of the first coordinate, how many entries lie before it
    std::vector<std::uint32_t> weights_;
    std::uint32_t first_reached_ = 0, end_reached_ = 0, total_ = 0;
    double share_ = 0.5, f_ = 1, g_ = 1, p0_ = 0, s0_ = 0, p1_ = 0, s1_ = 0;
};

/// The model of the entries of a stream, one node after the other.
class Model {
public:
    using Places = std::array<std::vector<double>, 3>;
    Model(const Lattice& lattice, const Places& places, const Prior* prior)
        : lattice_(lattice), predictors_{Predictor(places[0]), Predictor(places[1]), Predictor(places[2])},
          gains_(places[0], std::vector<double>(places[0].size())), shapes_(places[1], places[2]) {
        for (std::size_t c = 0; prior && c < 3; ++c) predictors_[c].begin_with(prior->weights[c], prior->levels[c]);
    }
    void begin(std::size_t row) {
        row_ = row;
        const std::size_t band = lattice_.band[row];
        if (row > 0) {
            higher_ = std::move(above_);
            above_ = std::move(present_);
            const std::size_t before = lattice_.band[row - 1];
            if (before != band) {
                above_ = moved(above_, before, band);
                if (row > 1) higher_ = moved(higher_, before, band);
            }
        }
        width_ = lattice_.phi_d[band].size();
        height_ = lattice_.theta_d[band].size();
        present_ = Plane(width_ * height_);
    }
    /// Reads the entries of a node.
    void read(Decoder& coder, std::size_t d, std::size_t p, std::uint16_t& gain, std::uint16_t& shape) {
        expect(d, p);
        gains_.weigh(predictors_[0].predicted(), predictors_[0].s(), 0.0, 0.0);
        gain = static_cast<std::uint16_t>(gains_.picked(coder));
        shapes_.weigh(predictors_[1].predicted(), predictors_[1].s(), predictors_[2].predicted(), predictors_[2].s());
        shape = static_cast<std::uint16_t>(shapes_.picked(coder));
        gains_.learn(gain);
        shapes_.learn(shape);
        Node& node = present_[d * width_ + p];
        node.values = {gains_.place(0, gain), shapes_.place(0, shape), shapes_.place(1, shape)};
        for (std::size_t c = 0; c < 3; ++c) node.errors[c] = predictors_[c].learn(node.values[c]);
    }
    std::size_t reached() const { return gains_.reached() + shapes_.reached(); }
private:
    struct Node {
        std::array<double, 3> values{}, errors{};
    };
    using Plane = std::vector<Node>;
    using Axis = std::vector<std::uint8_t>;
    struct Way {  // two neighbouring nodes on an axis, and the share of the second
        std::size_t first, second;
        double share;
    };
    static Way between(const Axis& axis, std::size_t count, int place) {
        std::size_t upper = 1;
        while (upper < count && axis[upper] <= place) ++upper;
        if (upper == count) return {upper - 1, upper - 1, 0.0};
        return {upper - 1, upper, double(place - axis[upper - 1]) / double(axis[upper] - axis[upper - 1])};
    }
    static Way around(const Axis& axis, int place) {
        const int last = axis.back();
        if (place < last) return between(axis, axis.size(), place);
        return {axis.size() - 1, 0, double(place - last) / double(fine - last)};
    }
    static double mixed(double a, double b, double share) {
        SOMMERL_EXACT
        return a * (1.0 - share) + b * share;
    }
    Plane moved(const Plane& plane, std::size_t old, std::size_t band) const {
        const Axis &theta_d = lattice_.theta_d[old], &phi_d = lattice_.phi_d[old];
        Plane made;
        for (const int y : lattice_.theta_d[band]) {
            const Way v = between(theta_d, theta_d.size(), y);
            for (const int x : lattice_.phi_d[band]) {
                const Way u = lattice_.mirrored ? between(phi_d, phi_d.size(), x) : around(phi_d, x);
                const Node &a = plane[v.first * phi_d.size() + u.first], &b = plane[v.first * phi_d.size() + u.second];
                const Node &c = plane[v.second * phi_d.size() + u.first], &d = plane[v.second * phi_d.size() + u.second];
                Node node;
                for (std::size_t i = 0; i < 3; ++i) {
                    node.values[i] = mixed(mixed(a.values[i], b.values[i], u.share), mixed(c.values[i], d.values[i], u.share), v.share);
                    node.errors[i] = mixed(mixed(a.errors[i], b.errors[i], u.share), mixed(c.errors[i], d.errors[i], u.share), v.share);
                }
                made.push_back(node);
            }
        }
        return made;
    }
    void expect(std::size_t d, std::size_t p) {
        SOMMERL_EXACT
        const Axis& phi_d = lattice_.phi_d[lattice_.band[row_]];
        const bool under = row_ > 0, left = p > 0, north = d > 0;
        const std::size_t line = d * width_, at = line + p, last = width_ - 1;
        std::size_t west = p > 0 ? p - 1 : last, east = p < last ? p + 1 : 0;
        if (lattice_.mirrored) west = p > 0 ? p - 1 : (last ? 1 : 0), east = p < last ? p + 1 : (last ? last - 1 : 0);
        const int m = fine - phi_d[p];
        const bool mirror = left && m <= phi_d[p - 1];
        const Way way = mirror ? between(phi_d, p, m) : Way{0, 0, 0.0};
        const Node *now = present_.data(), *above = above_.data(), *higher = higher_.data();
        for (std::size_t c = 0; c < 3; ++c) {
            const double before = left ? now[at - 1].values[c] : 0.0, over = north ? now[at - width_].values[c] : 0.0;
            const double up = under ? above[at].values[c] : left && north ? 0.5 * (before + over) : left ? before : over;
            double news = 0.0;
            if (mirror) {
                const double old = under ? mixed(above[line + way.first].values[c], above[line + way.second].values[c], way.share) : up;
                news = mixed(now[line + way.first].values[c], now[line + way.second].values[c], way.share) - old;
            }
            const double above_west = under ? above[line + west].values[c] : up;
            const double values[10] = {
                left ? before : above_west,
                north ? over : up,
                north ? now[line + west - width_].values[c] : up,
                north ? now[line + east - width_].values[c] : up,
                above_west,
                under && north ? above[at - width_].values[c] : up,
                under ? above[line + east].values[c] : up,
                under && d + 1 < height_ ? above[at + width_].values[c] : up,
                row_ > 1 ? higher[at].values[c] : up,
                up + news,
            };
            double errors[3];
            int count = 0;
            if (left) errors[count++] = now[at - 1].errors[c];
            if (north) errors[count++] = now[at - width_].errors[c];
            if (under) errors[count++] = above[at].errors[c];
            predictors_[c].predict(up, values, errors, count);
        }
    }
    const Lattice& lattice_;
    std::array<Predictor, 3> predictors_;
    Entries gains_, shapes_;
    Plane present_, above_, higher_;
    std::size_t row_ = 0, width_ = 0, height_ = 0;
};

#if defined(__GNUC__) && !defined(__clang__)
#pragma GCC pop_options
#endif

/// An axis of a lattice: closed ends at 180; open before; folded as closed, unless it is 0 alone.
enum class End { closed, open, folded };
inline bool read_axis(Decoder& coder, End end, Decoder::Context& counts, Decoder::Context& steps, std::vector<std::uint8_t>& axis) {
    const std::uint32_t count = coder.number(counts), inner = end == End::folded && count ? count - 1 : count;
    axis = {0};
    for (std::uint32_t i = 0; i < inner; ++i) {
        const std::uint32_t place = axis.back() + 1 + coder.number(steps);
        if (coder.lost() || place >= fine) return false;
        axis.push_back(static_cast<std::uint8_t>(place));
    }
    if (end == End::closed || inner < count) axis.push_back(fine);
    return !coder.lost();
}

inline bool read_lattice(Decoder& coder, Lattice& lattice) {
    auto counts = Decoder::context(), h = counts, d = counts, p = counts;
    const std::size_t bands = 1 + std::size_t(coder.number(counts));
    if (bands > 16 || !read_axis(coder, End::closed, counts, h, lattice.theta_h)) return false;
    for (std::size_t b = 0; b < bands; ++b) {
        const std::size_t left = lattice.theta_h.size() - lattice.band.size();
        const std::size_t rows = b + 1 == bands ? left : 1 + std::size_t(coder.number(counts));
        if (coder.lost() || rows < 1 || rows > left) return false;
        lattice.band.insert(lattice.band.end(), rows, static_cast<std::uint8_t>(b));
    }
    lattice.theta_d.resize(bands);
    lattice.phi_d.resize(bands);
    for (std::size_t b = 0; b < bands; ++b) {
        if (!read_axis(coder, End::closed, counts, d, lattice.theta_d[b])) return false;
        if (!read_axis(coder, lattice.mirrored ? End::folded : End::open, counts, p, lattice.phi_d[b])) return false;
    }
    return lattice.nodes() <= std::size_t(1) << 17;
}

/// Reads palette and entries, which follow the lattice. prior: of a part.
inline bool read_entries(Decoder& coder, std::size_t bytes, int version, const Prior* prior, Material& material) {
    auto counts = Decoder::context(), s = counts, u = counts, v = counts;
    const std::size_t gains = 1 + std::size_t(coder.number(counts)), shapes = 1 + std::size_t(coder.number(counts));
    if (coder.lost() || gains > 1024 || shapes > 1024) return false;
    Model::Places places;
    std::int32_t code = 0, first = -1024, second = 0;
    for (std::size_t i = 0; i < gains; ++i) {
        if (i > 0) code += 1 + static_cast<std::int32_t>(coder.number(s));
        else code = version == 1 ? static_cast<std::int32_t>(coder.number(s)) : coder.signed_number(s);
        if (coder.lost() || code < (version == 1 ? 0 : -4095) || code > 4095) return false;
        const int size = code < 0 ? -code : code;
        const double gain = 0.5 * (double(1u << (size / 128)) * (1.0 + double(size % 128) / 128.0) - 1.0);
        material.gains.push_back(code < 0 ? -gain : gain);
        places[0].push_back(double(code) / 128.0);
    }
    for (std::size_t i = 0; i < shapes; ++i) {
        first += static_cast<std::int32_t>(coder.number(u));
        if (coder.lost() || first > 1024) return false;
        second += coder.signed_number(v);
        if (coder.lost() || second < -1024 || second > 1024) return false;
        const double red_blue = double(first) / 64.0, green = 1.0 + double(second) / 64.0 * 2.0 / 3.0;
        material.palette.insert(material.palette.end(), {(3.0 - green + red_blue) / 2.0, green, (3.0 - green - red_blue) / 2.0});
        places[1].push_back(red_blue);
        places[2].push_back(double(second) / 64.0);
    }
    const Lattice& lattice = material.lattice;
    const std::size_t any = std::size_t(1) << 22, each = 1 << 11, all = std::size_t(1) << 26;
    const std::size_t most = bytes > (all - any) / each ? all : any + each * bytes;
    material.gain.resize(lattice.nodes());
    material.shape.resize(lattice.nodes());
    Model model(lattice, places, prior);
    std::size_t node = 0;
    for (std::size_t row = 0; row < lattice.band.size(); ++row) {
        model.begin(row);
        const std::size_t height = lattice.theta_d[lattice.band[row]].size(), width = lattice.phi_d[lattice.band[row]].size();
        for (std::size_t d = 0; d < height; ++d) {
            for (std::size_t p = 0; p < width; ++p, ++node) {
                model.read(coder, d, p, material.gain[node], material.shape[node]);
                if (coder.lost() || model.reached() > most) return false;
            }
        }
    }
    return coder.ends();
}

inline Error read_nodes(Reader& reader, int version, Material& material) {
    material.scale = reader.real();
    const std::uint64_t flags = version > 1 ? reader.number(1) : 1;
    if (!reader.fine()) return Error::truncated;
    if (!(material.scale > 0 && material.scale <= FLT_MAX) || flags > 15) return Error::contents;
    material.reciprocal = material.lattice.reciprocal = flags & 1;
    material.mirrored = material.lattice.mirrored = flags & 2;
    material.is_signed = flags & 4;
    material.smooth = flags & 8;
    Decoder coder(reader.rest());
    const bool fine_stream = read_lattice(coder, material.lattice) && read_entries(coder, reader.rest().size, version, nullptr, material);
    return fine_stream ? Error::none : Error::stream;
}

/// For each column of cells (θ_h, φ_d), how many are above the horizon: the first few in θ_d.
inline std::vector<std::uint16_t> above_horizon(const Material& material) {
    const auto [a, b, c] = material.bins;
    const double range = material.reciprocal ? pi : 2 * pi;
    std::vector<double> cos_d, sin_d, tilt;
    for (std::uint32_t j = 0; j < b; ++j) {
        const double theta_d = (j + 0.5) / b * (pi / 2);
        cos_d.push_back(std::cos(theta_d));
        sin_d.push_back(std::sin(theta_d));
    }
    for (std::uint32_t k = 0; k < c; ++k) tilt.push_back(std::fabs(std::cos((k + 0.5) / c * range)));
    std::vector<std::uint16_t> counts(std::size_t(a) * c);
    for (std::uint32_t i = 0; i < a; ++i) {
        const double x = (i + 0.5) / a, theta_h = x * x * (pi / 2), cos_h = std::cos(theta_h), sin_h = std::sin(theta_h);
        for (std::uint32_t k = 0; k < c; ++k) {
            std::uint32_t j = 0;
            while (j < b && cos_h * cos_d[j] - sin_h * sin_d[j] * tilt[k] > 1e-12) ++j;
            counts[std::size_t(i) * c + k] = static_cast<std::uint16_t>(j);
        }
    }
    return counts;
}

/// above: from `above_horizon`. entries: those of the cells above the horizon. Says whether all are below `clusters`.
template <class Entry>
bool fill_cells(const Material& material, const std::vector<std::uint16_t>& above, const std::uint8_t* entries, std::size_t clusters,
                std::vector<Entry>& index) {
    const auto [a, b, c] = material.bins;
    index.reserve(std::size_t(a) * b * c);
    // For each φ_d, the last one above the horizon so far: in θ_d, or else the last in θ_h that has one.
    std::vector<Entry> last(c);
    for (std::size_t i = 0; i < a; ++i) {
        for (std::size_t j = 0; j < b; ++j) {
            for (std::size_t k = 0; k < c; ++k) {
                if (j < above[i * c + k]) {
                    std::uint32_t number = *entries++;
                    if (sizeof(Entry) == 2) number |= std::uint32_t(*entries++) << 8;
                    if (number >= clusters) return false;
                    last[k] = static_cast<Entry>(number);
                }
                index.push_back(last[k]);
            }
        }
    }
    return true;
}

inline Error read_cells(Reader& reader, Material& material) {
    for (auto& bins : material.bins) bins = static_cast<std::uint32_t>(reader.number(2));
    const std::uint64_t reciprocal = reader.number(1), trilinear = reader.number(1), clusters = reader.number(4);
    if (!reader.fine()) return Error::truncated;
    const std::uint64_t size = std::uint64_t(material.bins[0]) * material.bins[1] * material.bins[2];
    if (size < 1 || size > most_cells || clusters < 1 || clusters > 65536 || reciprocal > 1 || trilinear > 1) return Error::contents;
    material.kind = Kind::cells;
    material.reciprocal = reciprocal;
    material.trilinear = trilinear;
    const auto above = above_horizon(material);
    std::size_t cells = 0;
    for (const auto count : above) cells += count;
    const std::size_t entries = static_cast<std::size_t>(clusters), width = entries <= 256 ? 1 : 2;
    std::vector<std::uint8_t> payload(24 * entries + width * cells);
    if (cells == 0) return Error::contents;
    if (!Inflater::inflate(reader.rest(), payload)) return Error::stream;
    Reader lut({payload.data(), 24 * entries});
    for (std::size_t i = 0; i < 3 * entries; ++i) {
        const std::uint64_t bits = lut.number(8);
        double value;
        std::memcpy(&value, &bits, 8);
        if (!(value >= 0 && value <= FLT_MAX)) return Error::contents;
        material.palette.push_back(value);
    }
    const std::uint8_t* index = payload.data() + 24 * entries;
    const bool fits = width == 1 ? fill_cells(material, above, index, entries, material.narrow)
                                 : fill_cells(material, above, index, entries, material.wide);
    return fits ? Error::none : Error::contents;
}

/// Reads the head that all files have but libraries: magic, version, checksum.
inline Error read_head(Reader& reader, const char* magic, std::uint64_t newest, int& version) {
    if (reader.rest().size < 10) return Error::truncated;
    if (reader.take(4).text() != magic) return Error::kind;
    const std::uint64_t found = reader.number(2), crc = reader.number(4);
    if (found < 1 || found > newest) return Error::version;
    version = static_cast<int>(found);
    return crc == crc32(reader.rest()) ? Error::none : Error::checksum;
}

inline Error read_origin(Reader& reader, Material& material) {
    const Bytes name = reader.take(reader.size(1));
    const std::size_t digest = reader.size(1);
    if (reader.fine() && (!is_utf8(name.text()) || (digest != 0 && digest != 32))) return Error::name;
    material.name = name.text();
    material.source_sha256 = hexadecimal(reader.take(digest));
    return reader.fine() ? Error::none : Error::truncated;
}

inline Error read_smrl(Bytes bytes, Material& material) {
    Reader reader(bytes);
    int version = 0;
    if (bytes.size > longest_file) return Error::contents;
    if (const Error error = read_head(reader, "SMRL", 2, version); failed(error)) return error;
    const std::uint64_t kind = reader.number(1);
    if (reader.fine() && kind != 1 && (kind != 0 || version != 1)) return Error::version;
    if (const Error error = read_origin(reader, material); failed(error)) return error;
    const Bytes notes = reader.take(reader.size(2));
    if (!reader.fine()) return Error::truncated;
    if (!notes_are_fine(notes.text())) return Error::notes;
    material.notes = notes.text();
    return kind ? read_nodes(reader, version, material) : read_cells(reader, material);
}

/// A number of half precision, by its bits.
inline float half(unsigned bits) {
    const int exponent = static_cast<int>(bits >> 10 & 31);
    const auto rest = static_cast<float>(bits & 1023);
    if (exponent == 31) return std::numeric_limits<float>::quiet_NaN();  // also infinity: both are refused
    const float size = exponent ? std::ldexp(1024.0f + rest, exponent - 25) : std::ldexp(rest, -24);
    return bits >> 15 ? -size : size;
}

inline Error read_fbrdf(Bytes bytes, Material& material) {
    Reader reader(bytes);
    int version = 0;
    if (bytes.size > 1 << 20) return Error::contents;
    if (const Error error = read_head(reader, "FBRD", 1, version); failed(error)) return error;
    if (const Error error = read_origin(reader, material); failed(error)) return error;
    material.kind = Kind::factored;
    material.reciprocal = false;
    material.mirrored = true;
    material.lobes = static_cast<unsigned>(reader.number(1));
    material.terms = static_cast<unsigned>(reader.number(1));
    const std::size_t lobes = material.lobes, all = lobes * material.terms;
    if (!reader.fine()) return Error::truncated;
    if (all < 1 || lobes > 32 || material.terms > 32 || all > 256) return Error::contents;
    const std::size_t n = 96 * lobes + 138 * all;
    std::vector<std::uint8_t> payload(2 * n + 4 * all);
    if (!Inflater::inflate(reader.rest(), payload)) return Error::stream;
    for (std::size_t i = 0; i < n; ++i) {
        const float value = half(payload[i] | unsigned(payload[n + i]) << 8);
        if (!(value >= 0 && value <= 1)) return Error::contents;
        (i < 96 * lobes ? material.f : i < 96 * lobes + 90 * all ? material.u : material.v).push_back(value);
    }
    Reader scales({payload.data() + 2 * n, 4 * all});
    for (std::size_t i = 0; i < all; ++i) {
        const float scale = scales.real();
        if (!(scale >= 0 && scale <= 1e30f)) return Error::contents;
        for (std::size_t row = 0; row < 90; ++row) material.u[row * all + i] *= scale;
    }
    return Error::none;
}

/// What the materials of a library may share.
struct Shared {
    std::vector<Lattice> lattices;
    Prior prior;
};

inline Error read_shared(Bytes bytes, Shared& shared) {
    Reader reader(bytes);
    const std::size_t count = reader.size(1);
    bool fits = count > 0;
    for (auto& weights : shared.prior.weights)
        for (double& weight : weights) fits = std::fabs(weight = reader.real()) <= 16 && fits;
    for (double& level : shared.prior.levels) fits = (level = reader.real()) > 0 && level <= 1024 && fits;
    std::vector<std::pair<std::uint64_t, std::string_view>> known;
    for (std::size_t i = 0; fits && i < count; ++i) {
        const std::uint64_t flags = reader.number(1);
        const Bytes stream = reader.take(reader.size(2));
        if (!reader.fine()) return Error::truncated;
        for (const auto& other : known) fits = fits && other != std::make_pair(flags, stream.text());
        known.emplace_back(flags, stream.text());
        Material even;
        even.lattice.reciprocal = flags & 1;
        even.lattice.mirrored = flags & 2;
        Decoder coder(stream);
        if (!read_lattice(coder, even.lattice) || !read_entries(coder, stream.size, 2, nullptr, even)) return Error::stream;
        const bool one = even.gains.size() == 1 && even.gains[0] == 0.0 && even.palette.size() == 3;
        fits = fits && flags <= 3 && one && even.palette[0] == 1.0 && even.palette[1] == 1.0;
        shared.lattices.push_back(std::move(even.lattice));
    }
    if (!reader.fine()) return Error::truncated;
    return fits && reader.rest().size == 0 ? Error::none : Error::contents;
}

inline Error read_part(Bytes bytes, const Shared& shared, Material& material) {
    Reader reader(bytes);
    const std::size_t number = reader.size(1);
    const std::uint64_t flags = reader.number(1);
    material.scale = reader.real();
    if (!reader.fine()) return Error::truncated;
    if (number >= shared.lattices.size() || (flags & ~std::uint64_t(12)) != 0) return Error::contents;
    if (!(material.scale > 0 && material.scale <= FLT_MAX)) return Error::contents;
    material.lattice = shared.lattices[number];
    material.reciprocal = material.lattice.reciprocal;
    material.mirrored = material.lattice.mirrored;
    material.is_signed = flags & 4;
    material.smooth = flags & 8;
    Decoder coder(reader.rest());
    return read_entries(coder, reader.rest().size, 2, &shared.prior, material) ? Error::none : Error::stream;
}

template <class Read> Error guarded(Read read) {
#ifdef SOMMERL_NO_EXCEPTIONS
    return read();
#else
    try {
        return read();
    } catch (const std::bad_alloc&) {
        return Error::memory;
    }
#endif
}

/// The bytes of a file of at most so many.
inline Error read_file(const std::string& path, std::uint64_t most, std::vector<std::uint8_t>& bytes) {
    std::ifstream file(path, std::ios::binary | std::ios::ate);
    const std::streamoff size = file ? std::streamoff(file.tellg()) : -1;
    if (size < 0) return Error::file;
    if (static_cast<std::uint64_t>(size) > most) return Error::contents;
    bytes.resize(static_cast<std::size_t>(size));
    file.seekg(0);
    file.read(reinterpret_cast<char*>(bytes.data()), size);
    return file ? Error::none : Error::file;
}

template <class Real> bool all_finite(const Real (&a)[3], const Real (&b)[3]) {
    // 0 if all are finite, else NaN.
    const Real all = (a[0] * 0 + a[1] * 0 + a[2] * 0) + (b[0] * 0 + b[1] * 0 + b[2] * 0);
    return all == 0;
}

/// The number of the bin of width 1 that holds x, from 0 to count - 1; of what is no number, 0.
template <class Real> std::size_t bin(Real x, std::size_t count) {
    const Real last = static_cast<Real>(count - 1), above = x > 0 ? x : 0;
    return static_cast<std::size_t>(static_cast<std::int32_t>(above < last ? above : last));
}

template <class Real> Real clamped(Real x, Real least, Real most) { return x < least ? least : x > most ? most : x; }

/// The angle of (x, y) for y >= 0, from 0 to pi, within 2 ulp. Reduction and polynomials are those of fdlibm (Sun 1993).
template <class Real> Real angle(Real y, Real x) {
    const Real a = std::fabs(x);
    const bool steep = y > a;
    const Real lower = steep ? a : y, upper = steep ? y : a;
    const bool middle = lower > Real(0.4375) * upper, high = lower > Real(0.6875) * upper;
    const Real top = high ? lower - upper : middle ? 2 * lower - upper : lower;
    const Real bottom = high ? lower + upper : middle ? 2 * upper + lower : upper;
    const Real base = high ? Real(0.785398163397448309616) : middle ? Real(0.4636476090008061) : Real(0);
    const Real t = top / (bottom == 0 ? Real(1) : bottom), z = t * t, w = z * z;
    Real series, rest = 0;
    if constexpr (sizeof(Real) == 4) {
        series = z * (Real(3.3333328366e-01) + w * (Real(1.4253635705e-01) + w * Real(6.1687607318e-02))) +
                 w * (Real(-1.9999158382e-01) + w * Real(-1.0648017377e-01));
    } else {
        rest = high ? 3.061616997868383e-17 : middle ? 2.2698777452961687e-17 : 0.0;
        series = z * (3.33333333333329318027e-01 + w * (1.42857142725034663711e-01 + w * (9.09088713343650656196e-02 +
                 w * (6.66107313738753120669e-02 + w * (4.97687799461593236017e-02 + w * 1.62858201153657823623e-02))))) +
                 w * (-1.99999999998764832476e-01 + w * (-1.11111104054623557880e-01 + w * (-7.69187620504482999495e-02 +
                 w * (-5.83357013379057348645e-02 + w * -3.65315727442169155270e-02))));
    }
    const Real flat = base - ((t * series - rest) - t), found = steep ? Real(pi / 2) - flat : flat;
    return x < 0 ? Real(pi) - found : found;
}

/// A material, prepared for lookup in one precision.
template <class Real> class Lookup {
public:
    using Triple = Real[3];
    explicit Lookup(const Material& material) : material_(&material) {
        if (material.kind == Kind::nodes) prepare_nodes();
        else for (const double value : material.palette) palette_.push_back(static_cast<Real>(value));
        for (const auto* part : {&material.f, &material.u, &material.v}) palette_.insert(palette_.end(), part->begin(), part->end());
    }
    void eval(const Triple& wi, const Triple& wo, Triple& out) const {
        out[0] = out[1] = out[2] = all_finite(wi, wo) ? Real(0) : std::numeric_limits<Real>::quiet_NaN();
        if (!(out[0] == 0 && wi[2] > 0 && wo[2] > 0)) return;
        if (material_->kind == Kind::nodes) nodes(wi, wo, out);
        else if (material_->kind == Kind::cells) cells(wi, wo, out);
        else factors(wi, wo, out);
        for (Real& value : out)
            if (!(std::fabs(value) <= Real(FLT_MAX))) value = value != value ? Real(0) : std::copysign(Real(FLT_MAX), value);
    }
private:
    struct Step {  // of the fine grid: the nodes below and after, the place of the first, 1 / the distance
        std::uint32_t below, after;
        Real place, per_width;
        Real share(Real x) const { return clamped((x - place) * per_width, Real(0), Real(1)); }
    };
    using Axis = std::array<Step, fine>;
    struct Value {
        Real r, g, b, unused;
    };
    template <class Number> static Axis steps(std::vector<std::uint8_t> axis, Number number) {
        Axis made;
        if (axis.back() != fine) axis.push_back(fine);  // where the first node of an axis that turns comes again
        std::size_t node = 0;
        for (std::size_t step = 0; step < fine; ++step) {
            node += axis[node + 1] <= step;
            made[step] = {number(node), number(node + 1), Real(axis[node]), Real(1) / Real(axis[node + 1] - axis[node])};
        }
        return made;
    }
    void prepare_nodes() {
        const Lattice& lattice = material_->lattice;
        base_.push_back(0);
        for (const auto b : lattice.band)
            base_.push_back(base_.back() + static_cast<std::uint32_t>(lattice.theta_d[b].size() * lattice.phi_d[b].size()));
        rows_ = steps(lattice.theta_h, [&](std::size_t row) { return static_cast<std::uint32_t>(row); });
        for (std::size_t b = 0; b < lattice.theta_d.size(); ++b) {
            const auto width = static_cast<std::uint32_t>(lattice.phi_d[b].size());
            bands_.push_back(steps(lattice.theta_d[b], [&](std::size_t node) { return static_cast<std::uint32_t>(node) * width; }));
            bands_.push_back(steps(lattice.phi_d[b], [&](std::size_t node) { return static_cast<std::uint32_t>(node) % width; }));
        }
        for (std::size_t i = 0; i < material_->gain.size(); ++i) {
            const double gain = material_->gains[material_->gain[i]], *shape = &material_->palette[3 * std::size_t(material_->shape[i])];
            values_.push_back({Real(gain * shape[0]), Real(gain * shape[1]), Real(gain * shape[2]), Real(0)});
        }
    }
    /// θ_h, θ_d, φ_d of Rusinkiewicz (1998), without arccosines.
    void half_diff(const Triple& wi, const Triple& wo, Triple& angles) const {
        const Real sx = wi[0] + wo[0], sy = wi[1] + wo[1], sz = wi[2] + wo[2];
        const Real vx = wi[0] - wo[0], vy = wi[1] - wo[1], vz = wi[2] - wo[2];
        const Real flat = sx * sx + sy * sy, s = std::sqrt(flat + sz * sz), v = std::sqrt((vx * vx + vy * vy) + vz * vz);
        angles[0] = angle(std::sqrt(flat), sz);
        angles[1] = angle(v, s);
        const Real x = 0 - vz * s, y = (vy * sx - vx * sy) + 0;
        const bool reciprocal = material_->reciprocal, other = !material_->mirrored && (y < 0 || (y == 0 && x < 0));
        const Real across = material_->mirrored && reciprocal ? std::fabs(x) : other ? -x : x;
        angles[2] = angle(std::fabs(y), across + 0) + (other && !reciprocal ? Real(pi) : Real(0));
    }
    void nodes(const Triple& wi, const Triple& wo, Triple& out) const {
        const bool reciprocal = material_->reciprocal, mirrored = material_->mirrored;
        Triple at;
        half_diff(wi, wo, at);
        const Real a = std::sqrt(at[0] * Real(2 / pi));
        const Real x = a < Real(0.25) ? a * 360 : 90 + (a - Real(0.25)) * 120, y = at[1] * Real(360 / pi);
        Real z = at[2] * Real(fine / (2 * pi / (reciprocal ? 2 : 1) / (mirrored ? 2 : 1)));
        if (!mirrored && z >= fine) z -= fine;
        const Step& row = rows_[bin(x, fine)];
        const std::size_t d = bin(y, fine), p = bin(z, fine);
        const Real t = row.share(x);
        Real r = 0, g = 0, b = 0;
        const auto blend = [&](std::size_t number, Real weight) {
            const std::size_t band = material_->lattice.band[number];
            const Step &theta_d = bands_[2 * band][d], &phi_d = bands_[2 * band + 1][p];
            const Real u = theta_d.share(y), v = phi_d.share(z);
            const auto line = [&](std::uint32_t first, Real w) {
                const Value &one = values_[base_[number] + first + phi_d.below], &two = values_[base_[number] + first + phi_d.after];
                const Real w1 = w * (1 - v), w2 = w * v;
                r += w1 * one.r, g += w1 * one.g, b += w1 * one.b;
                r += w2 * two.r, g += w2 * two.g, b += w2 * two.b;
            };
            line(theta_d.below, weight * (1 - u));
            line(theta_d.after, weight * u);
        };
        blend(row.below, 1 - t);
        blend(row.after, t);
        constexpr Real horizon = Real(0.0009), least = Real(0.01);
        const Real damped = material_->smooth ? std::sqrt((wi[2] * wi[2] + horizon) * (wo[2] * wo[2] + horizon))
                                              : (wi[2] > least ? wi[2] : least) * (wo[2] > least ? wo[2] : least);
        const Real factor = Real(material_->scale) / damped, value[] = {r, g, b};
        for (std::size_t c = 0; c < 3; ++c) out[c] = value[c] > 0 || material_->is_signed ? value[c] * value[c] * value[c] * factor : 0;
    }
    const Real* entry(std::size_t cell) const {
        return &palette_[3 * std::size_t(material_->wide.empty() ? material_->narrow[cell] : material_->wide[cell])];
    }
    void cells(const Triple& wi, const Triple& wo, Triple& out) const {
        const std::size_t a = material_->bins[0], b = material_->bins[1], c = material_->bins[2];
        Triple at;
        half_diff(wi, wo, at);
        const Real u = Real(a) * std::sqrt(at[0] * Real(2 / pi)), v = at[1] * Real(double(b) * 2 / pi);
        const Real w = at[2] * Real(double(c) / (material_->reciprocal ? pi : 2 * pi));
        if (!material_->trilinear) {
            const Real* found = entry(bin(w, c) + c * (bin(v, b) + b * bin(u, a)));
            for (std::size_t i = 0; i < 3; ++i) out[i] = found[i];
            return;
        }
        const auto between = [](Real position, std::size_t bins, std::size_t& first) {
            const Real x = clamped(position - Real(0.5), Real(0), Real(bins) - 1);
            first = bin(x, bins > 1 ? bins - 1 : 1);
            return x - Real(first);
        };
        std::size_t i, j;
        const Real share[2] = {between(u, a, i), between(v, b, j)}, below = std::floor(w - Real(0.5)), turn = w - Real(0.5) - below;
        const std::size_t k = bin(below < 0 ? below + Real(c) : below, c), after = k + 1 < c ? k + 1 : 0;
        const std::size_t up[2] = {a > 1 ? i + 1 : i, b > 1 ? j + 1 : j};
        for (std::size_t corner = 0; corner < 8; ++corner) {
            const bool h = corner & 4, d = corner & 2, p = corner & 1;
            const Real* found = entry((p ? after : k) + c * ((d ? up[1] : j) + b * (h ? up[0] : i)));
            const Real weight = (h ? share[0] : 1 - share[0]) * (d ? share[1] : 1 - share[1]) * (p ? turn : 1 - turn);
            for (std::size_t n = 0; n < 3; ++n) out[n] += weight * found[n];
        }
    }
    void factors(const Triple& wi, const Triple& wo, Triple& out) const {
        const std::size_t lobes = material_->lobes, terms = material_->terms, all = lobes * terms;
        const Real *f = palette_.data(), *u = f + 96 * lobes, *v = u + 90 * all;
        const Real hx = wi[0] + wo[0], hy = wi[1] + wo[1], hz = wi[2] + wo[2], x = wo[0] + Real(1e-9), y = wo[1];
        const auto between = [](Real place, std::size_t count, std::size_t& first) {
            const Real at = clamped(place - Real(0.5), Real(0), Real(count) - 1);
            first = bin(at, count - 1);
            return at - Real(first);
        };
        std::size_t row, column, node;
        const Real s = between(std::sqrt(angle(std::sqrt(hx * hx + hy * hy), hz) * Real(2 / pi)) * 90, 90, row);
        const Real t = between(angle(std::fabs(hy * x - hx * y), hx * x + hy * y) * Real(48 / pi), 48, column);
        const Real e = between(angle(std::sqrt(wo[0] * wo[0] + wo[1] * wo[1]), wo[2]) * Real(64 / pi), 32, node);
        for (std::size_t j = 0; j < lobes; ++j) {
            Real g = 0;
            for (std::size_t k = j * terms; k < (j + 1) * terms; ++k) {
                const Real u0 = u[all * row + k], u1 = u[all * (row + 1) + k], v0 = v[all * column + k], v1 = v[all * (column + 1) + k];
                g += (u0 + s * Real(float(u1 - u0))) * (v0 + t * Real(float(v1 - v0)));  // tables are in single precision
            }
            for (std::size_t c = 0; c < 3; ++c) {
                const Real f0 = f[3 * (lobes * node + j) + c], f1 = f[3 * (lobes * (node + 1) + j) + c];
                out[c] += g * (f0 + e * Real(float(f1 - f0)));
            }
        }
        const Real share = 1 / (wi[2] > Real(0.03) ? wi[2] : Real(0.03));
        for (std::size_t c = 0; c < 3; ++c) out[c] *= share;
    }
    const Material* material_;
    std::vector<Real> palette_;
    Axis rows_;
    std::vector<std::uint32_t> base_;
    std::vector<Axis> bands_;  // of each band, θ_d and φ_d
    std::vector<Value> values_;
};

/// Half vectors from a table for each elevation of the viewer: `sampling/half_vector.py` explains it, with the same names.
class Sampler {
public:
    explicit Sampler(const Material& material) {
        const Lookup<double> lookup(material);
        std::vector<Light> lights;
        for (std::size_t e = 0; e < between; ++e) lights.push_back(light(lookup, e));
        for (std::size_t e = 0; e < elevations; ++e) fill(lights, e);
    }
    template <class Real> Real draw(const Real (&wo)[3], const Real (&u)[3], Real (&wi)[3]) const {
        Real t, solid_angle;
        const std::size_t first = elevation(wo[2], t);
        const bool second = u[0] < t;
        const std::size_t slot = bin((second ? u[0] : u[0] - t) / (second ? t : 1 - t) * Real(whole), whole);
        const std::uint32_t word = table_[slot / slots + (second ? first + cells : first)];
        const std::size_t cell = slot % slots < word >> 24 ? word >> 16 & 255 : slot / slots;
        const Real side = 2 * u[2] - 1, s = (Real(cell / columns) + u[1]) * Real(1.0 / rows);
        mirrored(s, (Real(cell % columns) + std::fabs(side)) * Real(2.0 / columns), side, wo, wi, solid_angle);
        return wi[2] > 0 && solid_angle > Real(1e-35) ? share(first, t, cell) / solid_angle : Real(0);
    }
    template <class Real> Real density(const Real (&wi)[3], const Real (&wo)[3]) const {
        constexpr Real tiny = Real(1e-9), least = tiny * tiny;
        const Real x = wo[0] + tiny, y = wo[1], z = wo[2] > Real(lowest) ? wo[2] : Real(lowest);
        const Real hx = wi[0] + wo[0] + tiny, hy = wi[1] + wo[1], hz = wi[2] + z;
        const Real along = hx * x + hy * y, across = hx * y - hy * x;
        const Real plane = hx * hx + hy * hy, flat = plane > least ? plane : least, extent = extent_of(along, z * z * flat);
        const Real ratio = flat / ((flat + hz * hz) * extent), s = std::sqrt(std::sqrt(std::sqrt(ratio < 1 ? ratio : Real(1))));
        const Real edge = std::fabs(along) + std::fabs(across), rim = 1 / (edge > least ? edge : least);
        const std::size_t row = bin(s * Real(rows), rows), column = bin((1 - along * rim) * Real(columns / 2), columns);
        Real t;
        const std::size_t first = elevation(wo[2], t);
        return share(first, t, column + columns * row) * (s * hz) * ((x * x + y * y) * (rim * rim) * Real(1.0 / 32));
    }
private:
    static constexpr std::size_t rows = 20, columns = 8, elevations = 12, cells = rows * columns, slots = 256, whole = cells * slots;
    static constexpr std::size_t finer = 3, points = finer * finer, between = 2 * elevations - 1;
    static constexpr double lowest = 1e-4, diffuse = 0.01, neighbour = 0.07;
    struct Light {  // of each cell: root mean square of light, brightest light, cosine
        std::array<double, cells> rms{}, brightest{}, even{};
    };
    template <class Real> static std::size_t elevation(Real cos_o, Real& t) {
        const Real x = std::sqrt(cos_o > 0 ? cos_o : Real(0)) * Real(elevations - 1);
        const std::size_t node = bin(x, elevations - 1);
        t = x - Real(node);
        return cells * node;
    }
    template <class Real> Real share(std::size_t first, Real t, std::size_t cell) const {
        const Real here = Real(table_[first + cell] & 0xffff), next = Real(table_[first + cells + cell] & 0xffff);
        return (here + t * (next - here)) * Real(1.0 / slots);
    }
    template <class Real> static Real extent_of(Real along, Real upright2) {
        const Real r = std::sqrt(along * along + upright2), a = r + std::fabs(along);
        return (along < 0 ? upright2 : a * a) / (2 * r * a);
    }
    template <class Real> static void mirrored(Real s, Real c, Real side, const Real (&wo)[3], Real (&wi)[3], Real& solid_angle) {
        const Real x = 1 - c, size = 1 - std::fabs(x), y = side < 0 ? -size : size, round = x * x + y * y;
        const Real wx = wo[0] + Real(1e-9), wy = wo[1], wz = wo[2] > Real(lowest) ? wo[2] : Real(lowest);
        const Real across = wx * wx + wy * wy, scale = 1 / std::sqrt(round * across), tilt = x * across * scale;
        const Real extent = extent_of(tilt, wz * wz), s2 = s * s, s6 = s2 * s2 * s2, sin2 = s6 * s2 * extent;
        const Real sin = std::sqrt(sin2), cos = std::sqrt(1 - sin2), dot = sin * tilt + cos * wz, planar = 2 * dot * sin * scale;
        wi[0] = planar * (x * wx - y * wy) - wx;
        wi[1] = planar * (x * wy + y * wx) - wy;
        wi[2] = 2 * dot * cos - wz;
        solid_angle = 64 * (s6 * s) * extent * dot / (cos * round);
    }
    static Light light(const Lookup<double>& lookup, std::size_t e) {
        const double x = double(e) / double(between - 1), z = x * x > lowest ? x * x : lowest;
        const double wo[3] = {std::sqrt(1 - z * z), 0, z};
        Light made;
        std::array<double, 3> albedo{};
        std::array<std::array<double, 3>, cells> brightest{};
        double sum = 0;
        for (std::size_t cell = 0; cell < cells; ++cell) {
            std::array<double, 3> total{};
            for (std::size_t point = 0; point < points; ++point) {
                const std::size_t i = cell / columns * finer + point / finer, j = cell % columns * finer + point % finer;
                double wi[3], solid_angle, f_r[3];
                const double s = (double(i) + 0.5) / double(finer * rows), c = 2 * ((double(j) + 0.5) / double(finer * columns));
                mirrored(s, c, 1.0, wo, wi, solid_angle);
                const double cosine = (wi[2] > 0 ? wi[2] : 0) * solid_angle;
                lookup.eval(wi, wo, f_r);
                made.even[cell] += cosine / double(points);
                for (std::size_t n = 0; n < 3; ++n) {
                    const double value = f_r[n] * cosine;
                    made.rms[cell] += value * value;
                    total[n] += value;
                    brightest[cell][n] = point == 0 || value > brightest[cell][n] ? value : brightest[cell][n];
                }
            }
            made.rms[cell] = std::sqrt(made.rms[cell] / double(3 * points));
            sum += made.rms[cell];
            for (std::size_t c = 0; c < 3; ++c) albedo[c] += total[c] / double(points);
        }
        for (std::size_t cell = 0; cell < cells; ++cell) {
            made.rms[cell] /= sum > 0 ? sum : 1;
            made.brightest[cell] = -std::numeric_limits<double>::infinity();
            for (std::size_t c = 0; c < 3; ++c) {
                const double value = brightest[cell][c] / (albedo[c] > 0 ? albedo[c] : 1);
                if (value > made.brightest[cell]) made.brightest[cell] = value;
            }
        }
        return made;
    }
    /// The words of one elevation: probabilities, and Vose's alias table in whole slots.
    void fill(const std::vector<Light>& lights, std::size_t e) {
        std::array<double, cells> p{}, rest{};
        double total = 0, even = 0;
        for (std::size_t cell = 0; cell < cells; ++cell) {
            double near_light = lights[2 * e].brightest[cell];
            const std::size_t row = cell / columns, column = cell % columns;
            for (std::size_t l = e ? 2 * e - 2 : 0; l <= 2 * e + 2 && l < between; ++l)
                for (std::size_t i = row ? row - 1 : 0; i <= row + 1 && i < rows; ++i)
                    for (std::size_t j = column ? column - 1 : 0; j <= column + 1 && j < columns; ++j)
                        if (lights[l].brightest[columns * i + j] > near_light) near_light = lights[l].brightest[columns * i + j];
            p[cell] = lights[2 * e].rms[cell] > neighbour * near_light ? lights[2 * e].rms[cell] : neighbour * near_light;
            total += p[cell];
            even += lights[2 * e].even[cell];
        }
        std::array<std::uint32_t, cells> units{}, other{}, taken{}, left{};
        std::uint32_t missing = whole;
        for (std::size_t cell = 0; cell < cells; ++cell) {
            const double cosine = lights[2 * e].even[cell] / even, glossy = total > 0 ? p[cell] / total : cosine;
            const double exact = ((1 - diffuse) * glossy + diffuse * cosine) * double(whole - cells), floor = std::floor(exact);
            units[cell] = 1 + static_cast<std::uint32_t>(floor);
            rest[cell] = exact - floor;
            missing -= units[cell];
        }
        for (; missing > 0 && missing < cells; --missing) {
            std::size_t most = 0;
            for (std::size_t cell = 1; cell < cells; ++cell) most = rest[cell] > rest[most] ? cell : most;
            ++units[most];
            rest[most] = -1;
        }
        std::vector<std::size_t> poor, rich;
        left = units;
        for (std::size_t cell = 0; cell < cells; ++cell) (units[cell] < slots ? poor : rich).push_back(cell);
        while (!poor.empty() && !rich.empty()) {
            const std::size_t one = poor.back(), giver = rich.back();
            poor.pop_back();
            other[one] = static_cast<std::uint32_t>(giver);
            taken[one] = static_cast<std::uint32_t>(slots) - left[one];
            left[giver] -= taken[one];
            if (left[giver] < slots) rich.pop_back(), poor.push_back(giver);
        }
        for (std::size_t cell = 0; cell < cells; ++cell) table_[cells * e + cell] = units[cell] | other[cell] << 16 | taken[cell] << 24;
    }
    std::array<std::uint32_t, elevations * cells> table_{};
};
}  // namespace detail

/// A file of many materials (.smrlib). Its bytes stay in memory; materials are read when they are asked for.
class Library {
public:
    struct Entry {
        std::string name, source, source_sha256, options;  // options: an object of JSON
        std::uint64_t source_bytes = 0;
        std::array<float, 5> looks{};  // red, green, blue (linear), gloss, metalness
        std::vector<float> metrics;    // in the order of `metrics()`; NaN where there is none
    };
    static Library load(const std::string& path) {
        Library made;
        std::vector<std::uint8_t> bytes;
        made.error_ = detail::guarded([&] { return detail::read_file(path, std::uint64_t(1) << 40, bytes); });
        return made.error_ == Error::none ? load(std::move(bytes)) : made;
    }
    static Library load(std::vector<std::uint8_t> bytes) {
        Library made;
        made.bytes_ = std::move(bytes);
        made.error_ = detail::guarded([&] { return made.read(); });
        if (made.error_ != Error::none) made.entries_.clear();
        return made;
    }
    explicit operator bool() const { return error_ == Error::none; }
    Error error() const { return error_; }
    const std::vector<Entry>& entries() const { return entries_; }
    const std::vector<std::string>& metrics() const { return metrics_; }
private:
    template <class, class> friend class BasicBrdf;
    struct Place {
        std::size_t at, size;
        std::uint32_t crc, kind;
    };
    Error read() {
        using namespace detail;
        const Bytes all{bytes_.data(), bytes_.size()};
        Reader reader(all);
        if (all.size < 12) return Error::truncated;
        if (reader.take(4).text() != "SMLB") return Error::kind;
        if (reader.number(2) != 1) return Error::version;
        const std::uint64_t crc = reader.number(4), count = Reader(reader.rest()).number(2);
        if (count > 64 || reader.rest().size < 2 + 16 * count) return Error::checksum;
        if (crc32(reader.rest().part(0, static_cast<std::size_t>(2 + 16 * count))) != crc) return Error::checksum;
        reader.take(2);
        Reader sections({}), table(reader.take(static_cast<std::size_t>(16 * count)));
        Bytes index;
        std::size_t found[4] = {};
        bool shares = false;
        for (std::uint64_t i = 0; i < count; ++i) {
            const std::uint64_t type = table.number(2), flags = table.number(2), size = table.number(8), sum = table.number(4);
            if (size > reader.rest().size) return Error::truncated;
            const Bytes bytes = reader.take(static_cast<std::size_t>(size));
            if (type < 1 || type > 3) {
                if (flags & 1) return Error::version;
                continue;
            }
            if (found[type]++) return Error::contents;
            if (type != 2 && crc32(bytes) != sum) return Error::checksum;
            if (type == 1) index = bytes;
            if (type == 2) materials_ = {static_cast<std::size_t>(bytes.data - all.data), bytes.size, 0, 0};
            if (type == 3) {
                shares = true;
                if (size > 1 << 24) return Error::contents;
                if (const Error error = read_shared(bytes, shared_); failed(error)) return error;
            }
        }
        if (found[1] != 1 || found[2] != 1 || reader.rest().size != 0) return Error::contents;
        return read_index(index, shares);
    }
    Error read_index(detail::Bytes bytes, bool shares) {
        using namespace detail;
        Reader head(bytes);
        const std::uint64_t n = head.number(4), k = head.number(1);
        const std::uint64_t common = head.number(4), names = head.number(4), sources = head.number(4);
        if (!head.fine()) return Error::truncated;
        const std::uint64_t size = (65 + 4 * k) * n + common + names + sources;
        if (size > std::uint64_t(1) << 28 || size > 64 * std::uint64_t(bytes_.size()) || common > 1 << 20) return Error::contents;
        std::vector<std::uint8_t> payload(static_cast<std::size_t>(size));
        if (!Inflater::inflate(head.rest(), payload)) return Error::stream;
        const auto count = static_cast<std::size_t>(n);
        Reader reader({payload.data(), payload.size()});
        const auto column = [&](std::size_t width) { return reader.take(width * count); };
        const auto at = [](Bytes of, std::size_t i, std::size_t width) { return Reader(of.part(i * width, width)).number(width); };
        const Bytes name_lengths = column(2), source_lengths = column(2), lengths = column(4), crcs = column(4), kinds = column(1);
        const Bytes options = column(2), source_bytes = column(8), digests = column(32), looks = column(10);
        const Bytes values = column(4 * static_cast<std::size_t>(k));
        std::vector<std::string> sets;
        if (!read_common(reader.take(static_cast<std::size_t>(common)).text(), static_cast<std::size_t>(k), sets)) return Error::notes;
        Reader name_texts(reader.take(static_cast<std::size_t>(names))), source_texts(reader.take(static_cast<std::size_t>(sources)));
        std::size_t place = materials_.at, left = materials_.size;
        for (std::size_t i = 0; i < count; ++i) {
            const auto text = [&](Reader& texts, Bytes of) {
                const std::size_t length = static_cast<std::size_t>(at(of, i, 2));
                return length > 1 << 14 ? Bytes() : texts.take(length);
            };
            Entry entry;
            entry.name = text(name_texts, name_lengths).text();
            entry.source = text(source_texts, source_lengths).text();
            const bool known = is_utf8(entry.name) && is_utf8(entry.source) && (entry.name + entry.source).find('\0') == std::string::npos;
            if (!known || entry.name.empty() || (i > 0 && !(entries_[i - 1].name < entry.name))) return Error::name;
            const auto length = static_cast<std::size_t>(at(lengths, i, 4)), set = static_cast<std::size_t>(at(options, i, 2));
            const auto kind = static_cast<std::uint32_t>(at(kinds, i, 1));
            if (length > left || length > longest_file || set >= sets.size()) return Error::contents;
            if (kind > (shares ? 1 : 0)) return Error::version;
            places_.push_back({place, length, static_cast<std::uint32_t>(at(crcs, i, 4)), kind});
            place += length;
            left -= length;
            entry.options = sets[set];
            entry.source_bytes = at(source_bytes, i, 8);
            std::array<std::uint8_t, 32> digest;
            bool any = false;
            for (std::size_t b = 0; b < 32; ++b) any = (digest[b] = digests.data[b * count + i]) || any;
            if (any) entry.source_sha256 = hexadecimal({digest.data(), 32});
            for (std::size_t c = 0; c < 5; ++c) entry.looks[c] = float(at(looks, c * count + i, 2)) / 10000.0f;
            for (std::size_t m = 0; m < k; ++m) entry.metrics.push_back(Reader(values.part(4 * (m * count + i), 4)).real());
            entries_.push_back(std::move(entry));
        }
        const bool filled = left == 0 && name_texts.rest().size == 0 && source_texts.rest().size == 0;
        return filled && name_texts.fine() && source_texts.fine() ? Error::none : Error::contents;
    }
    /// Names of metrics, and sets of options.
    bool read_common(std::string_view text, std::size_t count, std::vector<std::string>& sets) {
        detail::Json json(text);
        int parts = 0;
        const auto metric = [&] {
            std::string_view name;
            bool fine = json.string(name) && detail::Json::length(name) <= 100 && metrics_.size() < 64;
            for (const std::string& other : metrics_) fine = fine && other != name;
            return metrics_.emplace_back(name), fine;
        };
        const auto set = [&] {
            json.next();
            const std::string_view start = json.rest();
            const bool fine = json.plain("source_facts");
            return sets.emplace_back(start.substr(0, start.size() - json.rest().size())), fine;
        };
        const bool whole = json.object([&](std::string_view key) {
            parts += key == "metrics" || key == "options";
            return key == "metrics" ? json.list(metric) : key == "options" ? json.list(set) : json.value(31);
        });
        return detail::is_utf8(text) && whole && json.ends() && parts == 2 && metrics_.size() == count;
    }
    std::vector<std::uint8_t> bytes_;
    Place materials_{};
    detail::Shared shared_;
    std::vector<Entry> entries_;
    std::vector<Place> places_;
    std::vector<std::string> metrics_;
    Error error_ = Error::not_loaded;
};

/// A material. Copies share what was read. Vector: three numbers that `v[0]`, `v[1]`, `v[2]` reads and `Vector{x, y, z}` makes.
template <class Real, class Vector = std::array<Real, 3>> class BasicBrdf {
public:
    BasicBrdf() = default;
    /// Reads a file (.smrl, .fbrdf), its bytes, or a material of a library. `error` tells whether that failed.
    static BasicBrdf load(const std::string& path) {
        std::vector<std::uint8_t> bytes;
        return made([&](detail::Material& material) {
            const Error error = detail::read_file(path, detail::longest_file, bytes);
            return error == Error::none ? parse({bytes.data(), bytes.size()}, material) : error;
        });
    }
    static BasicBrdf load(const void* bytes, std::size_t size) {
        return made([&](detail::Material& material) { return parse({static_cast<const std::uint8_t*>(bytes), size}, material); });
    }
    static BasicBrdf load(const Library& library, std::string_view name) {
        return made([&](detail::Material& material) {
            if (!library) return library.error_;
            std::size_t low = 0, high = library.entries_.size();
            while (low < high) {
                const std::size_t middle = (low + high) / 2;
                if (library.entries_[middle].name < name) low = middle + 1;
                else high = middle;
            }
            if (low == library.entries_.size() || library.entries_[low].name != name) return Error::missing;
            const Library::Place& place = library.places_[low];
            const detail::Bytes bytes{library.bytes_.data() + place.at, place.size};
            if (detail::crc32(bytes) != place.crc) return Error::checksum;
            if (place.kind == 0) return detail::read_smrl(bytes, material);
            const Library::Entry& entry = library.entries_[low];
            material.name = entry.name;
            material.source_sha256 = entry.source_sha256;
            material.notes = "{\"options\":" + entry.options + "}";
            return detail::read_part(bytes, library.shared_, material);
        });
    }
    explicit operator bool() const { return error_ == Error::none; }
    Error error() const { return error_; }
    /// f_r [1/sr], linear RGB. NaN where a component is NaN or infinite; else 0 where a direction is not above the horizon.
    Vector eval(const Vector& wi, const Vector& wo) const {
        const Real a[3] = {wi[0], wi[1], wi[2]}, b[3] = {wo[0], wo[1], wo[2]};
        Real f_r[3] = {};
        if (state_) state_->lookup.eval(a, b, f_r);
        return Vector{f_r[0], f_r[1], f_r[2]};
    }
    /// Draws a direction to the light, wi, with three random numbers from 0 to 1. pdf: its density [1/sr]; 0 if none was drawn.
    /// Returns f_r cos θ_i / pdf. All are NaN where a component is not finite or a random number is out of range.
    Vector sample(const Vector& wo, const Vector& u, Vector* wi, Real* pdf) const {
        const Real viewer[3] = {wo[0], wo[1], wo[2]}, numbers[3] = {u[0], u[1], u[2]};
        Real light[3] = {0, 0, 1}, f_r[3] = {}, density = 0;
        bool known = detail::all_finite(viewer, numbers);
        for (const Real number : numbers) known = known && number >= 0 && number <= 1;
        if (known && viewer[2] > 0 && state_) density = finite(state_->sampler().draw(viewer, numbers, light));
        if (!(density > 0)) density = light[0] = light[1] = 0, light[2] = 1;
        else state_->lookup.eval(light, viewer, f_r);
        const Real nan = std::numeric_limits<Real>::quiet_NaN(), share = density > 0 ? light[2] / density : Real(0);
        if (wi) *wi = known ? Vector{light[0], light[1], light[2]} : Vector{nan, nan, nan};
        if (pdf) *pdf = known ? density : nan;
        return known ? Vector{finite(f_r[0] * share), finite(f_r[1] * share), finite(f_r[2] * share)} : Vector{nan, nan, nan};
    }
    /// The density [1/sr] with which `sample` draws wi for wo. NaN and 0 as in `eval`.
    Real pdf(const Vector& wi, const Vector& wo) const {
        const Real a[3] = {wi[0], wi[1], wi[2]}, b[3] = {wo[0], wo[1], wo[2]};
        if (!detail::all_finite(a, b)) return std::numeric_limits<Real>::quiet_NaN();
        if (!(a[2] > 0 && b[2] > 0 && state_)) return 0;
        const Real found = finite(state_->sampler().density(a, b));
        return found > 0 ? found : 0;
    }
    const std::string& name() const { return material().name; }
    const std::string& source_sha256() const { return material().source_sha256; }  ///< in hexadecimal digits, or ""
    const std::string& notes() const { return material().notes; }                  ///< an object of JSON, or "": options, metrics
    Kind kind() const { return material().kind; }
    bool reciprocal() const { return material().reciprocal; }   ///< whether both orders of the directions give the same
    bool mirrored() const { return material().mirrored; }       ///< whether both sides of the viewer's plane give the same
    bool is_signed() const { return material().is_signed; }     ///< whether a channel may be negative
    bool trilinear() const { return material().trilinear; }     ///< whether values are interpolated
private:
    struct State {
        explicit State(detail::Material&& read) : material(std::move(read)), lookup(material) {}
        State(const State&) = delete;
        State& operator=(const State&) = delete;
        ~State() { delete fitted.load(); }
        /// Fitted when it is first asked for. Threads that ask at once may each fit one; the first stays.
        const detail::Sampler& sampler() const {
            const detail::Sampler* known = fitted.load(std::memory_order_acquire);
            if (known) return *known;
            auto own = std::make_unique<const detail::Sampler>(material);
            if (fitted.compare_exchange_strong(known, own.get(), std::memory_order_acq_rel)) return *own.release();
            return *known;
        }
        detail::Material material;
        detail::Lookup<Real> lookup;
        mutable std::atomic<const detail::Sampler*> fitted{nullptr};
    };
    static Real finite(Real x) { return x != x ? Real(0) : x > Real(FLT_MAX) ? Real(FLT_MAX) : x < Real(-FLT_MAX) ? Real(-FLT_MAX) : x; }
    static Error parse(detail::Bytes bytes, detail::Material& material) {
        const bool factored = bytes.size >= 4 && bytes.part(0, 4).text() == "FBRD";
        return factored ? detail::read_fbrdf(bytes, material) : detail::read_smrl(bytes, material);
    }
    template <class Read> static BasicBrdf made(Read read) {
        BasicBrdf brdf;
        brdf.error_ = detail::guarded([&] {
            detail::Material material;
            const Error error = read(material);
            if (error == Error::none) brdf.state_ = std::make_shared<const State>(std::move(material));
            return error;
        });
        return brdf;
    }
    const detail::Material& material() const {
        static const detail::Material none;
        return state_ ? state_->material : none;
    }
    std::shared_ptr<const State> state_;
    Error error_ = Error::not_loaded;
};

using Brdf = BasicBrdf<float>;
}  // namespace sommerl

#undef SOMMERL_EXACT
#endif
