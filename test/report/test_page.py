# SPDX-License-Identifier: Apache-2.0
"""Tables and pages."""

import csv
import io
import math
from dataclasses import replace
from html.parser import HTMLParser

import pytest

from socialcircle_ros.errors import SocialCircleError
from socialcircle_ros.report.content import Banner, Beside, Column, Picture, Pictures, Section, Table
from socialcircle_ros.report.page import check_page_name, render, sentence_in_html

TABLE = Table(
    'numbers',
    'A <title>',
    [Column('name'), Column('share', '.1%'), Column('none')],
    [['a, "b" & <c>', 0.12345, None], ['d', math.nan, 7]],
    note='1 < 2',
)


def test_a_picture_without_words_is_refused():
    with pytest.raises(ValueError, match='The picture p has no words'):
        Picture('p', b'', '')


def test_cells_are_formatted_by_their_columns():
    assert TABLE.texts() == [['a, "b" & <c>', '12.3 %', '–'], ['d', '–', '7']]


def test_numbers_have_a_true_minus_and_true_digits():
    columns = [Column('', '+.1%'), Column('', '.2f'), Column('', '+.3f'), Column('', ',d')]
    assert Table('', '', columns, [[-0.00001, 0.0012, 1.5, -3]]).texts() == [
        ['−0.0010 %', '0.0012', '+1.500', '−3']
    ]


def test_a_command_in_a_sentence_has_its_own_type_and_the_rest_is_escaped():
    assert sentence_in_html('try `a <b>` & go') == 'try <code>a &lt;b&gt;</code> &amp; go'
    assert '<li>try <code>this</code></li>' in render('', [], [Section('One', warnings=['try `this`'])])


def test_csv_has_numbers_at_full_precision():
    rows = list(csv.reader(io.StringIO(TABLE.csv())))
    assert rows == [['name', 'share', 'none'], ['a, "b" & <c>', '0.12345', ''], ['d', 'nan', '7']]


def test_a_page_does_not_get_the_name_of_something_else(tmp_path):
    for name in ('a.png', 'a', 'a.html.zip'):
        with pytest.raises(SocialCircleError, match='is not the name of a page: give one that ends in .html'):
            check_page_name(tmp_path / name)
    with pytest.raises(SocialCircleError, match='is a directory; give the name of a page'):
        check_page_name(tmp_path)
    for name in ('a.html', 'a.HTM'):
        check_page_name(tmp_path / name)


class _Tags(HTMLParser):
    """Collects the open tags and the link targets."""

    def __init__(self):
        super().__init__()
        self.open, self.links = [], []

    def handle_starttag(self, tag, attributes):
        self.links += [value for name, value in attributes if name in ('src', 'href')]
        if tag not in ('meta', 'img'):
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag


def test_the_page_is_complete_escaped_and_needs_no_other_file():
    sections = [
        Section('Head & shoulders', ['5 < 6'], ['found <this>'], [TABLE, Picture('p', b'\x89PNG', 'a "caption"')]),
        Section(
            'One',
            items=[
                Banner('failed', 'Failed & <sad>', ['1 <m>']),
                Pictures([Picture('p', b'\x89PNG', 'before & after')]),
                Beside([Table('', '', [Column(''), Column('')], [['<b>', 1]])]),
            ],
            warnings=['look & <see>'],
            anchor='one',
        ),
    ]
    page = render('Title', ['Introduction'], sections)
    tags = _Tags()
    tags.feed(page)
    assert tags.open == []
    assert all(link.startswith('data:image/png;base64,') for link in tags.links)
    for text in (
        'A &lt;title&gt;',
        'a, &#34;b&#34; &amp; &lt;c&gt;',
        '1 &lt; 2',
        'found &lt;this&gt;',
        '5 &lt; 6',
        'before &amp; after',
        '1 &lt;m&gt;',
        'Failed &amp; &lt;sad&gt;',
        '&lt;b&gt;',
        'look &amp; &lt;see&gt;',
    ):
        assert text in page
    assert page.index('found &lt;this&gt;') < page.index('Head &amp; shoulders')


def test_rows_link_to_their_sections():
    page = render(
        'Title', [], [Section('All', items=[replace(TABLE, links=['x', 'y'])]), Section('Y', anchor='y')]
    )
    tags = _Tags()
    tags.feed(page)
    assert tags.links == ['#x', '#y']
    assert '<section class="sheet" id="y">' in page
