/* Counts of a sensor in a packet of XELA's server: four hexadecimal digits each, and a list. */
#include "counts.h"

enum { N_DIGITS = 4, WIDTH = N_DIGITS + 1, MAX_DECIMALS = 5 };

/* Parse N_DIGITS hexadecimal digits; -1 for other characters. Readings follow no pattern that a
 * processor could predict, so there are no branches. */
static int32_t parse_number(const char *text)
{
    uint32_t value = 0, valid = 1;
    for (size_t i = 0; i < N_DIGITS; ++i) {
        const uint32_t c = (unsigned char)text[i];
        valid &= (c - '0' < 10) | ((c | 0x20) - 'a' < 6);
        value = 16 * value + (c & 15) + 9 * (c >> 6); /* letters are 0x41 to 46, 0x61 to 66 */
        value &= 0xffff;
    }
    return valid ? (int32_t)value : -1;
}

static bool parse_text(const char *text, size_t n, uint16_t *counts)
{
    const size_t n_counts = n / WIDTH;
    if (n_counts == 0 || n != WIDTH * n_counts + 1 || text[0] != '"') {
        return false;
    }
    for (size_t i = 0; i < n_counts; ++i, text += WIDTH) {
        const int32_t value = parse_number(text + 1);
        if (value < 0 || text[WIDTH] != (i + 1 < n_counts ? ',' : '"')) {
            return false;
        }
        counts[i] = (uint16_t)value;
    }
    return true;
}

/* Return whether a JSON list of whole numbers without signs has exactly these counts.
 *
 * Its last character is checked first: spaces and digits end there. */
static bool has_counts(const char *list, size_t n, const uint16_t *counts, size_t n_counts)
{
    size_t index = 1;
    if (n < 2 || list[0] != '[' || list[n - 1] != ']') {
        return false;
    }
    for (size_t i = 0; i < n_counts; ++i) {
        for (; list[index] == ' '; ++index) {
        }
        const size_t begin = index;
        uint32_t value = 0;
        for (; list[index] >= '0' && list[index] <= '9' && index <= begin + MAX_DECIMALS; ++index) {
            value = 10 * value + (uint32_t)(list[index] - '0');
        }
        if (index == begin || index > begin + MAX_DECIMALS || value != counts[i]) {
            return false;
        }
        for (; list[index] == ' '; ++index) {
        }
        if (list[index] != (i + 1 < n_counts ? ',' : ']')) {
            return false;
        }
        ++index;
    }
    return index == n;
}

bool holdfast_parse_counts(
    const char *text, size_t n_text, const char *list, size_t n_list, uint16_t *counts)
{
    return parse_text(text, n_text, counts) &&
           (list[0] == 'n' || has_counts(list, n_list, counts, n_text / WIDTH));
}
