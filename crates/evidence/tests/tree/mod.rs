//! Pages as a browser's parser reads them: what is not well-formed, and elements found by the few selectors that the
//! tests use.
//!
//! A tree of its own, as the crates that have one bring others along whose features `burn` is built with: tests would
//! build `burn` again.
use html5ever::tendril::{StrTendril, TendrilSink};
use html5ever::tree_builder::{ElementFlags, NodeOrText, QuirksMode, TreeSink};
use html5ever::{Attribute, QualName};
use std::borrow::Cow;
use std::cell::{Ref, RefCell};

/// Where the document itself is in the list of nodes.
const DOCUMENT: usize = 0;

/// A page that was read.
pub struct Page {
    /// What a browser would have had to mend.
    pub errors: Vec<Cow<'static, str>>,
    nodes: Vec<Node>,
}

struct Node {
    parent: Option<usize>,
    children: Vec<usize>,
    content: Content,
}

enum Content {
    Element(QualName, Vec<Attribute>),
    Text(String),
    /// The document, comments and the like, which no test asks for.
    Other,
}

impl Page {
    /// Reads a page from its first to its last letter.
    pub fn parse(html: &str) -> Self {
        let mut page = Self {
            errors: Vec::new(),
            nodes: Vec::new(),
        };
        page.add(Content::Other);
        html5ever::parse_document(Sink(RefCell::new(page)), Default::default()).one(html)
    }

    /// All elements in the order of the document.
    pub fn elements(&self) -> Vec<Element<'_>> {
        self.below(DOCUMENT)
            .into_iter()
            .filter_map(|node| self.element(node))
            .collect()
    }

    /// The elements that a selector means, in the order of the document.
    pub fn select(&self, selector: &str) -> Vec<Element<'_>> {
        let lists = parse(selector);
        let mut found = self.elements();
        found.retain(|element| lists.iter().any(|parts| element.matches(parts)));
        found
    }

    fn element(&self, node: usize) -> Option<Element<'_>> {
        match &self.nodes[node].content {
            Content::Element(name, attributes) => Some(Element {
                page: self,
                node,
                name,
                attributes,
            }),
            _ => None,
        }
    }

    /// All nodes inside one, in the order of the document.
    fn below(&self, node: usize) -> Vec<usize> {
        let mut found = Vec::new();
        let mut open: Vec<usize> = self.nodes[node].children.iter().rev().copied().collect();
        while let Some(node) = open.pop() {
            found.push(node);
            open.extend(self.nodes[node].children.iter().rev());
        }
        found
    }

    fn add(&mut self, content: Content) -> usize {
        self.nodes.push(Node {
            parent: None,
            children: Vec::new(),
            content,
        });
        self.nodes.len() - 1
    }

    fn position(&self, node: usize) -> Option<(usize, usize)> {
        let parent = self.nodes[node].parent?;
        let children = &self.nodes[parent].children;
        Some((parent, children.iter().position(|&child| child == node).unwrap()))
    }

    fn detach(&mut self, node: usize) {
        if let Some((parent, index)) = self.position(node) {
            self.nodes[parent].children.remove(index);
            self.nodes[node].parent = None;
        }
    }

    fn insert(&mut self, parent: usize, index: usize, child: NodeOrText<usize>) {
        let child = match child {
            NodeOrText::AppendNode(node) => node,
            NodeOrText::AppendText(text) => {
                // The parser hands texts over in pieces.
                let before = index.checked_sub(1).map(|i| self.nodes[parent].children[i]);
                if let Some(Content::Text(earlier)) = before.map(|node| &mut self.nodes[node].content) {
                    earlier.push_str(&text);
                    return;
                }
                self.add(Content::Text(text.to_string()))
            }
        };
        self.nodes[parent].children.insert(index, child);
        self.nodes[child].parent = Some(parent);
    }
}

/// An element of a page.
#[derive(Clone, Copy)]
pub struct Element<'a> {
    page: &'a Page,
    node: usize,
    name: &'a QualName,
    attributes: &'a [Attribute],
}

impl<'a> Element<'a> {
    pub fn name(&self) -> &'a str {
        &self.name.local
    }

    /// Attributes by name and value, prefixes like that of `xlink:href` left out.
    pub fn attrs(&self) -> impl Iterator<Item = (&'a str, &'a str)> + use<'a> {
        self.attributes.iter().map(|a| (&*a.name.local, &*a.value))
    }

    pub fn attr(&self, name: &str) -> Option<&'a str> {
        self.attrs().find(|(other, _)| *other == name).map(|(_, value)| value)
    }

    /// All text inside, as it stands there.
    pub fn text(&self) -> String {
        let texts = self.page.below(self.node).into_iter();
        texts
            .filter_map(|node| match &self.page.nodes[node].content {
                Content::Text(text) => Some(text.as_str()),
                _ => None,
            })
            .collect()
    }

    /// The elements inside this one that a selector means.
    pub fn select(&self, selector: &str) -> Vec<Element<'a>> {
        let mut found = self.page.select(selector);
        found.retain(|element| element.ancestors().any(|outer| outer.node == self.node));
        found
    }

    fn parent(&self) -> Option<Element<'a>> {
        self.page.element(self.page.nodes[self.node].parent?)
    }

    fn ancestors(&self) -> impl Iterator<Item = Element<'a>> + use<'a> {
        std::iter::successors(self.parent(), Element::parent)
    }

    fn siblings_before(&self) -> impl Iterator<Item = Element<'a>> + use<'a> {
        let page = self.page;
        let before = page
            .position(self.node)
            .map(|(parent, index)| &page.nodes[parent].children[..index]);
        before.into_iter().flatten().filter_map(|&node| page.element(node))
    }

    fn matches(&self, parts: &[Part]) -> bool {
        let [before @ .., Part::Element(conditions)] = parts else {
            unreachable!("selectors end with an element");
        };
        conditions.iter().all(|condition| self.meets(condition))
            && match before {
                [] => true,
                [outer @ .., Part::Child] => self.parent().is_some_and(|e| e.matches(outer)),
                [earlier @ .., Part::After] => self.siblings_before().any(|e| e.matches(earlier)),
                outer => self.ancestors().any(|e| e.matches(outer)),
            }
    }

    fn meets(&self, condition: &Condition) -> bool {
        match condition {
            Condition::Any => true,
            Condition::Tag(name) => self.name() == name,
            Condition::Class(name) => self
                .attr("class")
                .is_some_and(|names| names.split_ascii_whitespace().any(|n| n == name)),
            Condition::Has(name) => self.attr(name).is_some(),
            Condition::Is(name, value) => self.attr(name) == Some(value),
        }
    }
}

/// What selectors consist of, from left to right.
enum Part {
    /// All of these hold for one element.
    Element(Vec<Condition>),
    /// `>`
    Child,
    /// `~`
    After,
}

enum Condition {
    /// `*`
    Any,
    /// `name`
    Tag(String),
    /// `.name`
    Class(String),
    /// `[name]`
    Has(String),
    /// `[name='value']`
    Is(String, String),
}

/// Reads a list of selectors. Others than those above stop the test, as selectors that find nothing would let some
/// tests pass.
fn parse(selectors: &str) -> Vec<Vec<Part>> {
    let parts = selectors.split(',').map(|selector| {
        let parts = selector.split_whitespace().map(|part| match part {
            ">" => Part::Child,
            "~" => Part::After,
            _ => Part::Element(conditions(part)),
        });
        let parts: Vec<_> = parts.collect();
        let between = |part: Option<&Part>| !matches!(part, Some(Part::Element(_)));
        let doubled = parts.windows(2).any(|two| between(two.first()) && between(two.last()));
        assert!(
            !between(parts.first()) && !between(parts.last()) && !doubled,
            "{selector}"
        );
        parts
    });
    parts.collect()
}

fn conditions(part: &str) -> Vec<Condition> {
    let name = |text: &str| {
        let plain = |c: char| c.is_ascii_alphanumeric() || c == '-';
        assert!(!text.is_empty() && text.chars().all(plain), "{part}");
        text.to_owned()
    };
    let mut found = Vec::new();
    let mut rest = part;
    while !rest.is_empty() {
        if let Some(attribute) = rest.strip_prefix('[') {
            let (attribute, after) = attribute.split_once(']').expect(part);
            found.push(match attribute.split_once('=') {
                Some((key, value)) => {
                    let value = value.strip_prefix('\'').and_then(|v| v.strip_suffix('\''));
                    Condition::Is(name(key), value.expect(part).to_owned())
                }
                None => Condition::Has(name(attribute)),
            });
            rest = after;
        } else {
            let end = rest[1..].find(['.', '[']).map_or(rest.len(), |i| i + 1);
            let (one, after) = rest.split_at(end);
            found.push(match one.strip_prefix('.') {
                Some(class) => Condition::Class(name(class)),
                None if one == "*" => Condition::Any,
                None => Condition::Tag(name(one)),
            });
            rest = after;
        }
    }
    found
}

/// A page while it is read.
struct Sink(RefCell<Page>);

impl TreeSink for Sink {
    type Handle = usize;
    type Output = Page;
    type ElemName<'a> = Ref<'a, QualName>;

    fn finish(self) -> Page {
        self.0.into_inner()
    }

    fn parse_error(&self, message: Cow<'static, str>) {
        self.0.borrow_mut().errors.push(message);
    }

    fn get_document(&self) -> usize {
        DOCUMENT
    }

    fn elem_name<'a>(&'a self, target: &usize) -> Ref<'a, QualName> {
        Ref::map(self.0.borrow(), |page| page.element(*target).unwrap().name)
    }

    fn create_element(&self, name: QualName, attributes: Vec<Attribute>, _: ElementFlags) -> usize {
        self.0.borrow_mut().add(Content::Element(name, attributes))
    }

    fn create_comment(&self, _: StrTendril) -> usize {
        self.0.borrow_mut().add(Content::Other)
    }

    fn create_pi(&self, _: StrTendril, _: StrTendril) -> usize {
        self.0.borrow_mut().add(Content::Other)
    }

    fn append(&self, parent: &usize, child: NodeOrText<usize>) {
        let mut page = self.0.borrow_mut();
        let end = page.nodes[*parent].children.len();
        page.insert(*parent, end, child);
    }

    fn append_based_on_parent_node(&self, element: &usize, previous: &usize, child: NodeOrText<usize>) {
        let has_parent = self.0.borrow().nodes[*element].parent.is_some();
        if has_parent {
            self.append_before_sibling(element, child);
        } else {
            self.append(previous, child);
        }
    }

    // The parser itself tells of missing or old ones.
    fn append_doctype_to_document(&self, _: StrTendril, _: StrTendril, _: StrTendril) {}

    // What is in templates is looked at like the rest of the page.
    fn get_template_contents(&self, target: &usize) -> usize {
        *target
    }

    fn same_node(&self, one: &usize, other: &usize) -> bool {
        one == other
    }

    fn set_quirks_mode(&self, _: QuirksMode) {}

    fn append_before_sibling(&self, sibling: &usize, child: NodeOrText<usize>) {
        let mut page = self.0.borrow_mut();
        if let NodeOrText::AppendNode(node) = child {
            page.detach(node);
        }
        if let Some((parent, index)) = page.position(*sibling) {
            page.insert(parent, index, child);
        }
    }

    fn add_attrs_if_missing(&self, target: &usize, attributes: Vec<Attribute>) {
        if let Content::Element(_, known) = &mut self.0.borrow_mut().nodes[*target].content {
            for attribute in attributes {
                if known.iter().all(|a| a.name != attribute.name) {
                    known.push(attribute);
                }
            }
        }
    }

    fn remove_from_parent(&self, target: &usize) {
        self.0.borrow_mut().detach(*target);
    }

    fn reparent_children(&self, node: &usize, parent: &usize) {
        let mut page = self.0.borrow_mut();
        let moved = std::mem::take(&mut page.nodes[*node].children);
        for &child in &moved {
            page.nodes[child].parent = Some(*parent);
        }
        page.nodes[*parent].children.extend(moved);
    }
}
